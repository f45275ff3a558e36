"""Endpoint, region and credentials come from the environment only, and are never shown."""

from __future__ import annotations

import pytest

from tasks.files.installation import InstallationError
from tasks.object_storage.connection import connection_from

KEYS = {"AWS_ACCESS_KEY_ID": "AKIDEXAMPLE", "AWS_SECRET_ACCESS_KEY": "geheim", "AWS_SESSION_TOKEN": "pssst"}


def test_the_environment_says_where_and_as_whom() -> None:
    found = connection_from(
        {**KEYS, "AWS_REGION": "eu-central-1", "AWS_ENDPOINT_URL": "https://s3.example:9000/"}
    )
    assert (found.access_key, found.secret_key, found.session_token) == ("AKIDEXAMPLE", "geheim", "pssst")
    assert (found.region, found.endpoint) == ("eu-central-1", "https://s3.example:9000")
    assert (found.timeout_s, found.patience_s) == (30.0, 300.0)


def test_without_an_endpoint_it_is_that_of_the_region() -> None:
    found = connection_from({**KEYS, "AWS_DEFAULT_REGION": "eu-west-3"})
    assert (found.endpoint, found.region) == (None, "eu-west-3")


def test_a_connection_shows_nothing_secret() -> None:
    shown = repr(connection_from(KEYS))
    assert not [value for value in KEYS.values() if value in shown]


@pytest.mark.parametrize("missing", ["AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"])
def test_missing_credentials_are_named(missing: str) -> None:
    with pytest.raises(InstallationError, match=missing) as refused:
        connection_from({name: value for name, value in KEYS.items() if name != missing})
    assert "geheim" not in str(refused.value)


@pytest.mark.parametrize(
    "url", ["s3.example", "ftp://s3.example", "http://key:geheim@s3.example", "http://s3.example/bucket"]
)
def test_an_endpoint_that_is_no_server_is_refused_and_not_repeated(url: str) -> None:
    with pytest.raises(InstallationError, match="AWS_ENDPOINT_URL") as refused:
        connection_from({**KEYS, "AWS_ENDPOINT_URL": url})
    assert "geheim" not in str(refused.value)


def test_times_are_checked() -> None:
    found = connection_from({**KEYS, "AEROCAL_S3_PATIENCE": "0", "AEROCAL_S3_TIMEOUT": "2.5"})
    assert (found.patience_s, found.timeout_s) == (0.0, 2.5)
    for name, value in (
        ("AEROCAL_S3_PATIENCE", "long"),
        ("AEROCAL_S3_TIMEOUT", "0"),
        ("AEROCAL_S3_TIMEOUT", "nan"),
    ):
        with pytest.raises(InstallationError, match=name):
            connection_from({**KEYS, name: value})
