"""Carry out ``aerocal registry add``, ``approve``, ``export`` and ``verify``."""

from __future__ import annotations

import getpass
import re
import sys
from collections.abc import Sequence
from datetime import date
from pathlib import Path

from rich.console import Console
from rich.text import Text

from flows.command.exit_code import DONE, INPUT_ERROR, complain
from flows.command.registry_words import changes_table
from flows.command.screen_table import print_listed, screen
from tasks.errors import InputError
from tasks.files.installation import write_whole
from tasks.files.json_text import json_text
from tasks.plain_text import quoted
from tasks.registry.approval import Approval, approval_of
from tasks.registry.calibration_file import has_calibration, read_calibrations
from tasks.registry.contents import StoredCalibration
from tasks.registry.history import Validity
from tasks.registry.radiometric import RadiometricResult, changes, read_radiometric
from tasks.registry.registry import Registry, Signature
from tasks.registry.series import shared_numbers
from tasks.settings.registry import registry_address

# A digest, whole or enough of it that no other event has the same by chance.
_STATE = re.compile(r"[0-9a-fA-F]{16,64}")


def opened(address: str | None) -> Registry:
    """The registry: named by the option or the environment, otherwise in the user's data folder."""
    return Registry.at(registry_address(address))


def add_calibrations(
    source: Path, person: str | None, note: str, codes: Sequence[str], address: str | None
) -> int:
    """Add the records of a file or folder and report the outcome of each."""
    radiometric, signature = read_radiometric(source), Signature(_person(person), note)
    records = (
        () if radiometric is not None and not has_calibration(source) else read_calibrations(source, codes)
    )
    found = opened(address)
    for sealed in records:
        added = found.add(sealed, signature)
        _say_added(added, found.contents().sisters(added.camera))
    if radiometric is not None:
        _say_examined(found.add_radiometric(radiometric, signature), found.radiometric())
    return DONE


def _say_examined(added: RadiometricResult, known: Sequence[RadiometricResult]) -> None:
    """Report what was added, and what has changed since the previous result."""
    console, record = screen(), added.record
    console.print(Text(f"Added as radiometric result {added.id}: version {added.version} of {record.label}."))
    console.print(Text(f"Verification code {added.digest}"), soft_wrap=True)
    own = [one for one in known if one.record.camera_key == record.camera_key and one.id < added.id]
    if not own:
        console.print(Text("It is the first of its camera, so there is none to compare it with."))
        return
    compared = changes(own[-1].record, record)
    drifted = [one for one in compared if one.drifted]
    console.print(
        Text(f"Against result {own[-1].id}: {len(drifted)} of {len(compared)} quantities have changed.")
    )
    print_listed(console, (one.sentence for one in drifted), "yellow")


def _say_added(added: StoredCalibration, of_camera: Sequence[StoredCalibration]) -> None:
    camera, console = added.camera, screen()
    console.print(
        Text(f"Added as calibration {added.id}, a draft: version {added.version} of {camera.label}.")
    )
    console.print(Text(f"Verification code {added.sealed.digest}"), soft_wrap=True)
    if added.record.verdict == "refused":
        console.print(Text("The calibration was refused:", style="yellow"))
    print_listed(console, added.record.reasons, "yellow")
    if not camera.numbers:
        sentence = (
            f"It contains no serial number of body or lens, so any camera named '{camera.name}' is "
            f"regarded as the same one. Give cameras.{camera.name}.identity and calibrate again."
        )
        console.print(Text(sentence, style="yellow"))
    print_listed(console, shared_numbers(of_camera), "yellow")
    console.print(Text(f"Next: aerocal registry show {added.id}"))
    console.print(Text(f"      aerocal registry approve {added.id} --from DATE"))


def approve_calibration(
    number: str,
    days: tuple[date, date | None],
    person: str | None,
    note: str,
    although: str,
    address: str | None,
) -> int:
    """Show how a calibration differs from the one in force, then approve it."""
    found = opened(address)
    approval = approval_of(found.contents(), number, Validity(*days), although)
    console = screen()
    print_listed(console, shared_numbers(found.contents().sisters(approval.chosen.camera)), "yellow")
    show_comparison(approval, console)
    signature = Signature(_person(person), note)
    found.approve(approval, signature, although)
    label = approval.chosen.label
    console.print(
        Text(f"\nApproved by {signature.person}: {label}, valid {approval.validity}.", style="bold green")
    )
    for old, left in approval.supersedes:
        remains = "It is no longer valid." if left is None else f"It is valid for flights {left} only."
        console.print(Text(f"Superseded: {old.label}. {remains}"))
        lost = old.validity
        end = approval.validity.end
        if lost is not None and end is not None and (lost.end is None or lost.end > end):
            console.print(Text(f"After {end}, no calibration is in force.", style="yellow"))
    return DONE


def show_comparison(approval: Approval, console: Console) -> None:
    """The test of a calibration against the one in force before it."""
    before, test = approval.predecessor, approval.test
    if before is None or test is None:
        console.print(
            Text(
                f"Calibration {approval.chosen.id} is the first of its camera, so there is none to "
                "compare it with."
            )
        )
        return
    console.print(
        Text(f"Calibration {approval.chosen.id} against {before.label}, valid {before.validity}", "bold")
    )
    if test.changes:
        console.print(changes_table(test))
    print_listed(console, test.sentences, "" if test.agrees else "yellow")


def export_calibration(number: str, out: Path | None, address: str | None) -> int:
    """Write the content of a record, and nothing else."""
    if out is not None and out.is_dir():
        raise InputError(f"{out} is a folder.", "Name a file.", entity="--out")
    content = opened(address).calibration(number).sealed.content.encode()
    if out is None:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()
        return DONE
    write_whole(out, content)
    screen().print(Text(f"Calibration {number} is in {out}."), soft_wrap=True)
    return DONE


def verify_registry(since: str | None, address: str | None, *, as_json: bool) -> int:
    """Report whether every record is as it was written."""
    if since is not None and not _STATE.fullmatch(since):
        raise InputError(
            f"{quoted(since)} is not a state.",
            "Give the digest that `aerocal registry verify` printed, 16 of its digits or all.",
            entity="--since",
        )
    found = opened(address)
    contents, results = found.verified(), found.radiometric()
    sentences = [finding.sentence for finding in contents.findings]
    if since and not any(event.digest.startswith(since.lower()) for event in contents.events):
        sentences.append(f"The state {since} is not part of the history: earlier events were rewritten.")
    if as_json:
        print(
            json_text(
                {
                    "registry": str(found.database.address),
                    "sound": not sentences,
                    "findings": sentences,
                    "calibrations": len(contents.calibrations),
                    "events": len(contents.events),
                    "radiometric_results": len(results),
                    "state": contents.digest or None,
                },
                indent=2,
            )
        )
    if not sentences:
        counts = f"calibrations: {len(contents.calibrations)}, events: {len(contents.events)}"
        counts += f", radiometric results: {len(results)}" if results else ""
        if not as_json:
            words = f"All is as it was written ({counts}).\nState {contents.digest or 'empty'}"
            screen().print(Text(words), soft_wrap=True)
        return DONE
    if not as_json:
        print_listed(screen(stderr=True), sentences, wrap=False)
    complain(
        f"{len(sentences)} thing{'s' * (len(sentences) > 1)} in the registry {found.database.address} "
        "not written by aerocal. Restore it from a backup."
    )
    return INPUT_ERROR


def _person(option: str | None) -> str:
    """Name of the person responsible.

    Raises
    ------
    InputError
        If the account has no name.
    """
    if option is not None:
        return option.strip()
    try:
        return getpass.getuser()
    except (KeyError, OSError) as error:
        raise InputError("The person responsible is not known.", "Name them: --by NAME.") from error
