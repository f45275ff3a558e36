"""Findings of the tests of the model in words: what differs, where, by how much, and what to check."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from tasks.evaluation.alternative_words import (
    CERTAIN,
    LEAST_PART,
    POWER,
    PRIOR,
    WHOLE,
    alike_words,
    alternative_words,
    where,
)
from tasks.quantities import COMPONENTS, additional_set, entity_words, quantity_words, shown, with_unit
from tasks.results.figures import ModelFinding, StripScatter


@dataclass(frozen=True)
class _Kind:
    """One kind of alternative: its words, what to check, and its axes where it is not a kind of parameters.

    ``place``: its axes are east, north and up, and its size is said as "too far west" or "too high".
    ``part``: what a small part of a mistake is a part of that is made as a whole or not at all.
    ``whole``: what to do first where it concerns all images alike. ``{reject}`` of a remedy is what may be
    done only where gross errors are not rejected already.
    """

    words: str
    remedy: str
    axes: tuple[str, ...] = ()
    place: bool = False
    whole: str = ""
    part: str = ""


_SMALL = "It is too small for a mistake that is made as a whole; an unknown error has a similar effect."
_REJECT = ", or reject gross errors (adjustment.rejection)"
_NO_REJECTION = (
    ", then those of the other points; rejecting gross errors cannot determine which of them is wrong, more "
    "control points or GNSS positions can"
)
_KINDS: Mapping[str, _Kind] = {
    "lever_arm": _Kind(
        "The lever arm of camera {entity}{where} looks wrong by {size} (forward x, right y, down z)",
        "Check lever_arm_m: from the camera to the antenna, and whether the positions are reduced already.",
        whole="If it is not known, free lever_arm (adjustment.free).",
    ),
    "time_offset": _Kind(
        "The times of the exposures{of_entity} look wrong against the positions: {size}",
        "Check the event times and the interpolation of the trajectory, or free time_offset.",
    ),
    "boresight": _Kind(
        "Camera {entity} and INS have a different relative orientation{where}: {size}",
        "Was one of them remounted, or the INS realigned? Then declare a separate camera for that flight "
        "(inputs.exposures.flights).",
        whole="If it has not been calibrated, free boresight (adjustment.free).",
    ),
    "focal_length": _Kind(
        "The focal length of camera {entity} differs{where} by {size}",
        "Check focus, temperature and pressure, and heights of GNSS and control.",
    ),
    "principal_point": _Kind(
        "The principal point of camera {entity} differs{where} by {size}",
        "Check pixel_origin and the image axes of this delivery, and the timing of the exposures.",
    ),
    "gnss_shift": _Kind(
        "The GNSS positions{where} are {size} relative to the other positions and the control",
        "Check their datum, base station and antenna height, or free the shift.",
        place=True,
    ),
    "gnss_drift": _Kind(
        "The GNSS positions{where} drift by {size} (east x, north y, up z)",
        "Check their solution (ambiguities, base station), or free gnss_drift.",
    ),
    "ins_drift": _Kind(
        "The INS attitudes{where} drift by {size}",
        "Check their solution (alignment, GNSS gaps), or free ins_drift.",
    ),
    "gnss_position": _Kind(
        "The GNSS position of image {entity} is {size}",
        "Check its time and its solution{reject}.",
        ("x", "y", "z"),
        place=True,
    ),
    "ins_attitude": _Kind(
        "The INS attitude of image {entity} does not fit: computed − given {size}",
        "Check its time{reject}.",
        ("roll", "pitch", "yaw"),
    ),
    "control_point": _Kind(
        "The given coordinates of control point {entity} are {size}",
        "Check them and its measurement in the images{reject}.",
        ("x", "y", "z"),
        place=True,
    ),
    "gnss_height_scale": _Kind(
        "The heights of the GNSS positions have a different scale from the other observations: {size}",
        "Check whether these heights are ellipsoidal and in metres.",
    ),
    "convergence": _Kind(
        "The attitudes appear to refer to the other north: {size} of the angle between grid and true north "
        "is contained in them",
        "Check angles.reference; 100 %: true instead of grid north; −100 %: grid instead of true north.",
        part="the angle between grid and true north in the attitudes",
    ),
    "angle_order": _Kind(
        "The angles appear to have ω and φ in the other order: {size} of the difference is contained in them",
        "Check angles.order of the exposures; 100 %: phi-omega-kappa was declared omega-phi-kappa; −100 %: "
        "the reverse.",
        part="the difference between the two orders of ω and φ",
    ),
    "control_shift": _Kind(
        "The control points are shifted against the GNSS positions by {size} (east x, north y, up z)",
        "Check datum and height system (geoid undulation) of both.",
        ("x", "y", "z"),
    ),
    "control_tilt": _Kind(
        "The heights of the control points are tilted by {size}",
        "Check the geoid model of both deliveries.",
        ("east", "north"),
    ),
    "control_turn": _Kind(
        "The control points are turned about the vertical by {size}", "Check the CRS of both deliveries."
    ),
    "control_scale": _Kind(
        "The control points have a different horizontal scale: {size}",
        "Check whether the coordinates have a local ground scale instead of that of the project CRS.",
    ),
    "control_height_scale": _Kind(
        "The heights of the control points have a different scale: {size}", "Check their unit."
    ),
    "refraction": _Kind(
        "The refraction differs from the applied correction by {size} of it",
        "Near −100 % it was corrected twice: set adjustment.refraction to match the delivered image "
        "coordinates.",
    ),
    "distortion_direction": _Kind(
        "The distortion given for camera {entity} appears to be defined in the other direction: {size} "
        "of the difference is found in the images",
        "100 % confirms the other direction: values of OpenCV, COLMAP and Metashape belong to "
        "brown-forward, those of laboratories and Australis to brown; aerocal convert-distortion converts.",
        part="the difference between the two directions of the distortion given for camera {entity}",
    ),
    "distortion_sign": _Kind(
        "The additional parameters given for camera {entity} appear to have the wrong sign: {size} of the "
        "difference is found in the images",
        "100 % confirms the other sign: check whether corrections or errors were published.",
        part="the difference between the two signs of the additional parameters given for camera {entity}",
    ),
}
_GIVEN = _Kind(
    "The given {given} contradicts the block: it looks wrong by {size}",
    "Check the value and its σ (adjustment.priors, or the calibration in the registry).",
)
_IMAGE_ERRORS = _Kind(
    "The images of camera {entity} have systematic errors that no estimated parameter describes: {size}",
    "Free additional parameters (adjustment.self_calibration) or give the known distortion.",
)
# What may vary from strip to strip → the parameters of strips that describe it.
_OF_STRIPS = {
    "gnss_shift": "gnss_strip_bias",
    "gnss_drift": "gnss_drift",
    "boresight": "ins_strip_bias",
    "ins_drift": "ins_drift",
}
# Quantity → its kind and axis, of what is not a parameter.
_QUANTITIES = {
    "_".join(filter(None, (name, axis))): (name, axis)
    for name, kind in _KINDS.items()
    for axis in kind.axes or ("",)
}


def model_findings(alternatives: pd.DataFrame, *, rejecting: bool = False) -> tuple[ModelFinding, ...]:
    """The causes in a table of alternatives, the most likely first; axes of the same thing are one cause.

    Parameters
    ----------
    rejecting : whether gross errors were rejected.
    """
    chosen = alternatives[alternatives["rank"] > 0].sort_values("rank")
    runner_up = _runner_up(alternatives)
    causes: dict[tuple[str, str, str, str], list[Mapping[Hashable, object]]] = {}
    for row in chosen.to_dict("records"):
        kind, _ = _kind_and_axis(str(row["quantity"]))
        key = (kind, str(row["entity"]), str(row["scope"]), str(row["part"]))
        causes.setdefault(key, []).append(row)
    return tuple(
        _finding(number, key, rows, runner_up, rejecting)
        for number, (key, rows) in enumerate(causes.items(), start=1)
    )


def strip_scatter_sentences(scatters: Sequence[StripScatter]) -> Iterator[str]:
    """Quantities that vary from strip to strip, and what describes that in an adjustment."""
    for item in scatters:
        family = COMPONENTS[item.quantity].kind.name if item.quantity in COMPONENTS else ""
        free = _OF_STRIPS.get(family)
        remedy = f" Free {free} (adjustment.free), or give its prior a larger σ." if free else ""
        yield f"{scatter_words(item)} The σ of all results leave that out.{remedy}"


def scatter_words(item: StripScatter) -> str:
    """By how much a quantity varies from strip to strip."""
    unit, factor, _ = shown(item.unit)
    return (
        f"The {quantity_words(item.quantity)} varies between strips by {item.scatter * factor:.2g} {unit} "
        f"(RMS), more than expected from its σ (χ² {item.statistic:.0f} of {item.freedom})."
    )


def _runner_up(alternatives: pd.DataFrame) -> str:
    """The most likely alternative that is not a finding, with its t, for comparison with a finding."""
    left = alternatives[(alternatives["rank"] == 0) & alternatives["t"].notna()]
    if left.empty:
        return ""
    row = left.iloc[int(left["t"].abs().to_numpy().argmax())].to_dict()
    of = f" of {row['entity']}" if row["entity"] else ""
    return f"; next: {alternative_words(row)}{of} with t = {abs(row['t']):.1f}"


def _kind_and_axis(quantity: str) -> tuple[str, str]:
    """The kind of a quantity and its axis; of an additional parameter its set and name."""
    if quantity.startswith(PRIOR):
        return quantity, ""
    if quantity in COMPONENTS:
        return COMPONENTS[quantity].kind.name, COMPONENTS[quantity].axis
    if quantity in _QUANTITIES:
        return _QUANTITIES[quantity]
    of_set = additional_set(quantity)
    return of_set, quantity[len(of_set) + 1 :]


def _finding(
    number: int,
    key: tuple[str, str, str, str],
    rows: list[Mapping[Hashable, object]],
    runner_up: str,
    rejecting: bool,
) -> ModelFinding:
    kind, entity, scope, part = key
    moving = max(rows, key=lambda row: float(str(row["moved_by_estimate"])))
    words = _GIVEN if kind.startswith(PRIOR) else _KINDS.get(kind, _IMAGE_ERRORS)
    if kind in WHOLE and all(map(_is_small, rows)):
        words = _Kind("An error looks like {size} of " + words.part, _SMALL)
    text = words.words.format(
        entity=entity,
        given=entity_words(kind.removeprefix(PRIOR), entity),
        of_entity=f" of flight {entity}" if entity else "",
        where=where(scope, part),
        size=", ".join(map(_displacement if words.place else _size, rows))
        + (_computed_minus_given(rows) if words.place else ""),
    )
    likeliest = max(rows, key=lambda row: abs(_t(row)))
    t = _t(likeliest)
    critical = float(str(likeliest["detectable"])) / float(str(likeliest["sigma"])) - POWER
    moved_by = float(str(moving["moved_by_estimate"]))
    # Null where nothing is estimated that could be moved.
    moves = (
        entity_words(moving["moves"], str(moving["moves_entity"])) if isinstance(moving["moves"], str) else ""
    )
    effect = f" The result is affected: {moves} is off by {moved_by:.1f} times its σ." if moves else ""
    # Components of the same thing are no other cause.
    own = {alike_words(row) for row in rows}
    others = dict.fromkeys(
        other
        for row in rows
        if isinstance(row["alike"], str)
        for other in row["alike"].split(", ")
        if other not in own
    )
    alike = f" Nearly indistinguishable from it: {', '.join(others)}." if others else ""
    alone = abs(float(str(likeliest["t"])))
    # Later findings may explain part of it; each was significant when it was found.
    size = (
        f"{abs(t):.1f}" if abs(t) >= critical else f"{alone:.1f} alone, {abs(t):.1f} with the other findings"
    )
    tested = f"(t = {size}, critical value {critical:.1f}{runner_up})"
    remedy = words.remedy if part or not words.whole else f"{words.whole} {words.remedy}"
    remedy = remedy.replace("{reject}", "" if rejecting else _of_rejection(kind, entity, others))
    sentence = f"{text} {tested}.{alike}{effect} {remedy}"
    return ModelFinding(
        rank=number,
        quantity=kind,
        entity=entity,
        scope=scope,
        part=part,
        t=t,
        moves=moves,
        moved_by=moved_by,
        sentence=sentence,
        alike_points=tuple(sorted(_points(others) - {entity})),
    )


def _points(others: Iterable[str]) -> set[str]:
    """The control points among what looks alike: "control point z of C012"."""
    return {other.partition(" of ")[2] for other in others if other.startswith("control point ")}


def _of_rejection(kind: str, entity: str, others: Iterable[str]) -> str:
    """What rejection would do; of control points that look alike it rejects none."""
    return _NO_REJECTION if kind == "control_point" and _points(others) - {entity} else _REJECT


def _is_small(row: Mapping[Hashable, object]) -> bool:
    """Whether something is certainly a smaller part of itself than a mistake made as a whole."""
    size, sigma = (float(str(row[name])) for name in ("explained", "explained_sigma"))
    return abs(size) + CERTAIN * sigma < LEAST_PART


def _t(row: Mapping[Hashable, object]) -> float:
    return float(str(row["explained"])) / float(str(row["explained_sigma"]))


def _size(row: Mapping[Hashable, object]) -> str:
    """Axis, size and its σ: ``x +0.100 ± 0.004 m``."""
    _, axis = _kind_and_axis(str(row["quantity"]))
    unit, factor, _ = shown(str(row["unit"]))
    value, sigma = (float(str(row[name])) * factor for name in ("explained", "explained_sigma"))
    # The size is that of the error in what was given; an attitude is said as its residual.
    value = -value if str(row["quantity"]).startswith("ins_attitude") else value
    sign = "−" if value < 0.0 else "+"
    size = f"{abs(value):,.0f} ± {sigma:,.0f}" if sigma >= 100.0 else f"{abs(value):.3g} ± {sigma:.2g}"
    return with_unit(f"{f'{axis} ' if axis else ''}{sign}{size}", unit)


_TOO = {"x": ("far east", "far west"), "y": ("far north", "far south"), "z": ("high", "low")}


def _displacement(row: Mapping[Hashable, object]) -> str:
    """``0.375 ± 0.021 m too far west``."""
    _, axis = _kind_and_axis(str(row["quantity"]))
    value, sigma = (float(str(row[name])) for name in ("explained", "explained_sigma"))
    return f"{with_unit(f'{abs(value):.3g} ± {sigma:.2g}', 'm')} too {_TOO[axis][value < 0.0]}"


def _computed_minus_given(rows: list[Mapping[Hashable, object]]) -> str:
    """The same with the sign of all tables and maps: `` (computed − given x +0.375, z −0.250 m)``."""
    sizes = (
        f"{_kind_and_axis(str(row['quantity']))[1]} {-float(str(row['explained'])):+.3g}" for row in rows
    )
    return f" (computed − given {', '.join(sizes).replace('-', '−')} m)"
