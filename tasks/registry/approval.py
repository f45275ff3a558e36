"""Approval of a calibration: what is examined before, what it supersedes, and objections."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from tasks.errors import InputError
from tasks.plain_text import is_blank
from tasks.registry.compatibility import Compatibility, compatibility
from tasks.registry.contents import Contents, StoredCalibration
from tasks.registry.history import Event, Validity


@dataclass(frozen=True)
class Approval:
    """A calibration that is to be approved, with the basis of the decision.

    Attributes
    ----------
    chosen : the calibration.
    validity : the days on which it shall hold.
    predecessor : the approved one it is compared with; None: the first one of its camera.
    test : how the two differ.
    supersedes : what it takes validity from, with what is left of it (None: nothing).
    decided : the decisions about its camera that were known, as digests.
    """

    chosen: StoredCalibration
    validity: Validity
    predecessor: StoredCalibration | None
    test: Compatibility | None
    supersedes: tuple[tuple[StoredCalibration, Validity | None], ...]
    decided: frozenset[str]


def approval_of(contents: Contents, text: str, validity: Validity, although: str = "") -> Approval:
    """The effect of an approval, and the difference from the calibration in force.

    Parameters
    ----------
    text : id of the calibration, or the beginning of its digest.
    although : why a record is approved that its own calibration refuses.

    Raises
    ------
    InputError
        If it cannot be approved, or the registry was edited.
    """
    contents.require_untouched()
    chosen = contents.calibration(text)
    require_approvable(contents, chosen, validity, although)
    before = predecessor(contents, chosen, validity)
    return Approval(
        chosen,
        validity,
        before,
        None if before is None else compatibility(chosen.record, before.record),
        tuple(superseded_by(contents, chosen, validity)),
        frozenset(event.digest for event in _decisions(contents, chosen)),
    )


def require_approvable(
    contents: Contents, chosen: StoredCalibration, validity: Validity, although: str
) -> None:
    """Refuse an approval that makes no sense.

    Raises
    ------
    InputError
        If the calibration is not a draft, is refused by its own limits, or would begin before another one.
    """
    if chosen.state != "draft":
        done = chosen.approval
        by = "" if done is None else f", by {done.person} on {done.at[:10]}, valid {done.validity}"
        raise InputError(
            f"{_capital(chosen.label)} is not a draft: it was approved already{by}.",
            "An approval is final; a later calibration supersedes it.",
        )
    if validity.end is not None and validity.end < validity.start:
        raise InputError(f"The validity ends on {validity.end}, before it begins.", "Correct --from or --to.")
    if although and is_blank(although):
        raise InputError("The reason is blank.", "State it: --although REASON.", entity="--although")
    if chosen.record.verdict == "refused" and not although:
        reasons = " ".join(chosen.record.reasons) or "It gives no reason."
        raise InputError(
            f"{_capital(chosen.label)} was refused by the acceptance test: {reasons}",
            'Fly again, or state why it should be approved nevertheless: --although "REASON".',
        )
    for item in _same_mounting(contents, chosen):
        held = item.validity
        if held is not None and held.overlaps(validity) and held.start > validity.start:
            raise InputError(
                f"{_capital(item.label)} of the same camera is approved {held}, which is later than "
                f"{validity.start}.",
                f"Use --from {held.start} or later to supersede it, or --to with an earlier end.",
            )


def approved_meanwhile(contents: Contents, approval: Approval) -> None:
    """Refuse an approval if another one of the same camera was made since the examination.

    Raises
    ------
    InputError
        Saying who approved what.
    """
    new = [
        event
        for event in _decisions(contents, approval.chosen)
        if event.digest not in approval.decided and event.state == "approved"
    ]
    if not new:
        return
    event = new[-1]
    other = contents.calibration(str(event.calibration))
    raise InputError(
        f"In the meantime, {event.person} has approved {other.label}, valid {event.validity} ({event.at}): "
        f"{approval.chosen.label} was not approved and nothing was changed.",
        f"Look at it (`aerocal registry show {other.id}`) and approve again if yours should be in force.",
    )


def superseded_by(
    contents: Contents, chosen: StoredCalibration, validity: Validity
) -> Iterator[tuple[StoredCalibration, Validity | None]]:
    """Calibrations that a new approval supersedes, each with its remaining validity."""
    for item in _same_mounting(contents, chosen):
        if item.validity is not None and item.validity.overlaps(validity):
            yield item, item.validity.before(validity.start)


def predecessor(
    contents: Contents, chosen: StoredCalibration, validity: Validity
) -> StoredCalibration | None:
    """The approved calibration a new one is compared with.

    That of the same mounting which holds on its first day, or held last before; without one that of another
    mounting, whose camera is the same.
    """
    earlier = [
        (
            item.camera.mounting_key == chosen.camera.mounting_key,
            held.contains(validity.start),
            held.start,
            item,
        )
        for item in contents.sisters(chosen.camera)
        if item.id != chosen.id and (held := item.validity) is not None and held.start <= validity.start
    ]
    return max(earlier, key=lambda entry: (*entry[:3], entry[3].id))[3] if earlier else None


def _same_mounting(contents: Contents, chosen: StoredCalibration) -> Iterator[StoredCalibration]:
    for item in contents.sisters(chosen.camera):
        if item.id != chosen.id and item.camera.mounting_key == chosen.camera.mounting_key:
            yield item


def _decisions(contents: Contents, chosen: StoredCalibration) -> Iterator[Event]:
    """Approvals and supersessions of the same camera."""
    for item in contents.sisters(chosen.camera):
        yield from (event for event in item.events if event.state != "draft")


def _capital(text: str) -> str:
    return text[0].upper() + text[1:]
