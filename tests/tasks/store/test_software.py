"""What two processes must have in common to write the same bytes."""

from __future__ import annotations

from dataclasses import replace

from tasks.store.software import software_here
from tasks.store.source_digest import digest_of_application


def test_the_same_software_does_not_differ() -> None:
    assert software_here().differences(software_here()) == ()
    assert software_here().sources == digest_of_application()


def test_other_libraries_and_sources_are_named() -> None:
    here = software_here()
    numpy = dict(here.versions)["numpy"]
    other = replace(
        here,
        sources="0" * 64,
        versions=tuple((name, "1.0" if name == "numpy" else text) for name, text in here.versions[:-1]),
    )
    last, version = here.versions[-1]
    assert set(here.differences(other)) == {
        f"numpy 1.0 in place of {numpy}",
        f"{last} missing in place of {version}",
        "other source files of aerocal",
    }


def test_another_processor_is_no_difference_of_the_software() -> None:
    here = software_here()
    assert here.differences(replace(here, processor="another")) == ()
