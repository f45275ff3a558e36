"""Where the registry is, and that a password never shows."""

from __future__ import annotations

import ssl
from pathlib import Path

import pytest

from tasks.errors import InputError
from tasks.settings.registry import REGISTRY_VARIABLE, registry_address

SERVER = "postgresql://ann:very-secret@db.example.org:6543/calibrations"


def test_the_option_goes_before_the_environment_and_that_before_the_folder_of_the_user(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "home"))
    environment = {REGISTRY_VARIABLE: str(tmp_path / "b.sqlite")}
    assert registry_address(str(tmp_path / "a.sqlite"), environment).file == tmp_path / "a.sqlite"
    assert registry_address(None, environment).file == tmp_path / "b.sqlite"
    assert registry_address(None, {}).file == tmp_path / "home" / "aerocal" / "registry.sqlite"


@pytest.mark.parametrize("text", ["data/r.sqlite", "sqlite:///data/r.sqlite"])
def test_a_file_is_named_by_path_or_url(text: str) -> None:
    assert registry_address(text, {}).file == Path.cwd() / "data" / "r.sqlite"


def test_the_password_is_for_the_driver_only() -> None:
    found = registry_address(SERVER, {})
    assert found.url.password == "very-secret"
    assert str(found) == "postgresql://ann:***@db.example.org:6543/calibrations"
    assert "very-secret" not in repr(found) + str(found)
    assert found.file is None


def test_the_environment_gives_the_password_and_user_an_address_does_not() -> None:
    environment = {"PGPASSWORD": "very-secret", "USER": "ann"}
    found = registry_address("postgresql://db/calibrations", environment)
    assert (found.url.username, found.url.password) == ("ann", "very-secret")
    assert str(found) == "postgresql://ann:***@db/calibrations"
    assert registry_address(SERVER.replace("very-secret", "own"), environment).url.password == "own"


@pytest.mark.parametrize(
    ("mode", "verified"), [("disable", None), ("require", ssl.CERT_NONE), ("verify-full", ssl.CERT_REQUIRED)]
)
def test_a_connection_is_encrypted_as_the_address_says(mode: str, verified: ssl.VerifyMode | None) -> None:
    context = registry_address(f"{SERVER}?sslmode={mode}", {}).ssl_context
    if verified is None:
        assert context is False
    else:
        assert isinstance(context, ssl.SSLContext)
        assert context.verify_mode == verified
        assert context.check_hostname == (mode == "verify-full")


@pytest.mark.parametrize(
    "text",
    [
        "mysql://ann:very-secret@db/x",
        "postgresql://ann:very-secret@db",
        "postgresql://ann:very-secret@db:port/x",
        f"{SERVER}?sslmode=perhaps",
        f"{SERVER}?options=x",
        "sqlite://",
        "://ann:very-secret@db/x",
    ],
)
def test_what_is_no_address_is_refused_without_repeating_it(text: str) -> None:
    with pytest.raises(InputError) as error:
        registry_address(text, {})
    assert "very-secret" not in str(error.value)
    assert "registry" in str(error.value) or "option" in str(error.value)
