"""The list of versions of the site; what Sphinx builds is checked by ``make docs`` itself."""

from __future__ import annotations

import subprocess
from pathlib import Path

from docs.generate.site import tags, write_versions


def test_tags_of_versions_are_listed_newest_first(tmp_path: Path) -> None:
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@example.org"]
    for command in (["init", "-q"], ["commit", "-q", "--allow-empty", "-m", "a"]):
        subprocess.run([*git, *command], cwd=tmp_path, check=True)
    for name in ("v0.9.0", "v0.10.0", "v0.2.1", "seen-by-a-customer"):
        subprocess.run([*git, "tag", name], cwd=tmp_path, check=True)
    assert tags(tmp_path) == ["v0.10.0", "v0.9.0", "v0.2.1"]


def test_without_git_there_are_no_tags(tmp_path: Path) -> None:
    assert tags(tmp_path) == []


def test_the_address_of_the_site_leads_to_the_newest_version(tmp_path: Path) -> None:
    write_versions(tmp_path, ["v0.10.0", "main"])
    assert (tmp_path / "versions.js").read_text() == 'const VERSIONS = ["v0.10.0", "main"];\n'
    assert 'url=v0.10.0/docs/index.html"' in (tmp_path / "index.html").read_text()
