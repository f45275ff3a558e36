"""Addresses on object storage, ``s3://BUCKET/PREFIX``, and whether a text denotes a folder or an address.

An address holds nothing secret: endpoint, region and credentials come from the environment only
(`tasks.object_storage.connection`), so that addresses may be in logs, reports and states.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from tasks.errors import InputError
from tasks.plain_text import quoted, trouble_in

_SCHEME = "s3://"
_FORM = "Write s3://BUCKET/PREFIX, with letters, digits, points and hyphens in the name of the bucket."
_SECRETS = (
    "Write s3://BUCKET/PREFIX only; endpoint, region and credentials come from the environment "
    "(AWS_ENDPOINT_URL, AWS_REGION, AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY)."
)
_BUCKET = re.compile(r"[a-z0-9][a-z0-9.-]{1,61}[a-z0-9]")
#: What a name on object storage may not contain: it would mean something else in a URL or on a screen.
_ODD = re.compile(r"[\x00-\x1f\x7f\\?#]")
#: Names of objects have at most 1024 bytes; ours need some 250 below the prefix.
_MOST_BYTES = 700
#: What a path, and a part of it, may have; results lie below.
_LONGEST_PATH, _LONGEST_PART = 3_000, 255


@dataclass(frozen=True)
class ObjectAddress:
    """The location of the objects of a workspace.

    Attributes
    ----------
    bucket : name of the bucket; it exists already.
    prefix : what the names of all objects begin with, without a slash at either end; never empty.
    """

    bucket: str
    prefix: str

    def __str__(self) -> str:
        return f"{_SCHEME}{self.bucket}/{self.prefix}"

    def path_of(self, name: str) -> str:
        """The path of the object `name` below the prefix: bucket, prefix and name."""
        return f"{self.bucket}/{self.prefix}/{name}"

    def below(self, *parts: str) -> ObjectAddress:
        """The address of a place further down.

        Raises
        ------
        InputError
            If a part cannot be one of an address.
        """
        return _checked(self.bucket, "/".join([self.prefix, *parts]))


def address_of(text: str) -> ObjectAddress:
    """The address that a text denotes.

    Raises
    ------
    InputError
        If it is none. A text with something like credentials or options in it is not repeated.
    """
    if not text.lower().startswith(_SCHEME):
        raise InputError(f"'{text}' is not an address of object storage.", _FORM)
    bucket, _, prefix = text[len(_SCHEME) :].partition("/")
    if "@" in bucket or ":" in bucket or "?" in text:
        raise InputError("The address of the object storage contains more than bucket and prefix.", _SECRETS)
    return _checked(bucket, prefix.strip("/"))


def output_place(text: str) -> Path | ObjectAddress:
    """A folder, or an address on object storage: whichever `text` means.

    Raises
    ------
    InputError
        If it looks like an address of a kind that is not known.
    """
    if not text.strip():
        raise InputError("The output folder is blank.", "Name one, or omit the option.", entity="--out")
    if re.match(r"s3:/", text, re.IGNORECASE):
        return address_of(text)
    scheme = re.match(r"([a-z][a-z0-9+.-]+)://", text, re.IGNORECASE)
    if scheme is not None:
        raise InputError(
            f"Results cannot be written to {scheme[1]}://.", "Name a folder, or s3://BUCKET/PREFIX."
        )
    return output_folder(text)


def output_folder(text: str) -> Path:
    """The folder that a text denotes.

    Raises
    ------
    InputError
        If no folder can have this name.
    """
    trouble = trouble_in(text, _LONGEST_PATH)
    if trouble is not None or max(len(os.fsencode(part)) for part in text.split("/")) > _LONGEST_PART:
        raise InputError(
            trouble or f"The name of the folder {quoted(text)} is too long.",
            "Name another folder for the results.",
        )
    return Path(text)


def _checked(bucket: str, prefix: str) -> ObjectAddress:
    if not _BUCKET.fullmatch(bucket):
        raise InputError(f"'{bucket}' is not the name of a bucket.", _FORM)
    if not prefix:
        raise InputError(f"The address {_SCHEME}{bucket} has no prefix.", _FORM)
    # A client would take ".." for the way up, out of the prefix.
    if _ODD.search(prefix) or any(part in ("", ".", "..") for part in prefix.split("/")):
        raise InputError(
            f"'{prefix}' is not allowed in an address of object storage.",
            "Leave out empty parts, '.', '..', backslashes, '?', '#' and control characters.",
        )
    if len(prefix.encode()) > _MOST_BYTES:
        raise InputError(
            "The address of the object storage is too long.", f"Use at most {_MOST_BYTES} bytes."
        )
    return ObjectAddress(bucket, prefix)
