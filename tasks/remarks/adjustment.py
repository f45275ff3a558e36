"""Remarks on the whole of an adjustment: global test, groups, rejections, datum, events.

Those that the report does not repeat where it has already named their cause are functions of their own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from adjust.quality.detectability import UNCONTROLLED
from tasks.quantities import group_words
from tasks.results.figures import (
    AdjustmentFigures,
    FreeNetworkFigure,
    GlobalTestFigure,
    GroupFigure,
    LateHeadFigure,
    SharedMoments,
    TrustMapGrid,
)

# σ0 of a group is worth a remark outside these limits, if the group has some redundancy.
_LIMITS = (0.7, 1.4)
_LEAST_REDUNDANCY = 10.0
# Fewer rejected observations are gross errors, whatever part of their group, unless two are all of it.
_SEVERAL = 3
_MOST_NAMES, _MOST_PARAMETERS = 5, 8
_UNCONTROLLED = {
    "image_points": (
        ("image coordinate is uncontrolled", "image coordinates are uncontrolled"),
        "points with two rays along the base",
    ),
    "control_points": (
        ("coordinate of control points is uncontrolled", "coordinates of control points are uncontrolled"),
        "heights of points in two images",
    ),
}
_WITHOUT_EFFECT = {
    "gnss_correlation_s": "no GNSS positions are observed",
    "ins_correlation_s": "no INS attitudes are observed",
    "variance_components_by": "variance components are not estimated (adjustment.variance_components)",
}
_CONSTRAINED = {
    "object_points": "object points",
    "projection_centres": "projection centres",
    "both": "object points and projection centres",
}


def global_test_sentences(figures: AdjustmentFigures, sigma0: float, redundancy: float) -> Iterator[str]:
    """That the block has no redundancy, or fails the global test."""
    test = figures.global_test
    if redundancy <= 0:
        yield "The block has no redundancy: no observation is checked by others."
    elif test is not None and not test.passed:
        yield global_test_words(sigma0, test)


def global_test_words(sigma0: float, test: GlobalTestFigure) -> str:
    """A sentence that the global test fails."""
    found, lower, upper = beside_limits(sigma0, test.lower or 0.0, test.upper or 0.0)
    return (
        f"The global test fails: σ0 is {found}, expected from the stated σ: {lower} to "
        f"{upper} ({100 * test.confidence:g} %)."
    )


def beside_limits(value: float, *limits: float) -> tuple[str, ...]:
    """A number and its limits with three decimals; with more where it would look like one of them."""
    for decimals in range(3, 7):
        words = tuple(f"{number:.{decimals}f}" for number in (value, *limits))
        if words[0].lstrip("-") not in words[1:]:
            break
    return words


def group_sentences(figures: AdjustmentFigures) -> Iterator[str]:
    """Groups of which most was rejected, which is one error of all of them, and groups that do not fit."""
    for group in figures.groups:
        every = group.rejected_rows == group.rows > 1
        if every or (
            group.rows and group.rejected_rows >= _SEVERAL and group.rejected_rows > 0.5 * group.rows
        ):
            yield (
                f"{group.rejected_rows:,} of {group.rows:,} {group_words(group.group)} were rejected, so "
                "they hardly contribute to the result. So many must have a common cause, such as their "
                "datum, height system, lever arm or σ."
            )
    for group in figures.groups:
        if words := misfit_words(group):
            yield words


def misfit_words(group: GroupFigure) -> str | None:
    """A sentence if the σ of a group do not fit its residuals; None: they do, or it is unknown."""
    sigma0, redundancy = group.sigma0, group.redundancy or 0.0
    if sigma0 is None or redundancy < _LEAST_REDUNDANCY or _LIMITS[0] <= sigma0 <= _LIMITS[1]:
        return None
    verdict = "worse" if sigma0 > 1.0 else "better"
    return (
        f"The {group_words(group.group)} fit {verdict} than their σ predict: σ0 of the group is {sigma0:.2f} "
        f"(redundancy {redundancy:,.0f})."
    )


def rejection_sentences(figures: AdjustmentFigures) -> Iterator[str]:
    """What was rejected as gross errors, and what could not be tested."""
    counts = [
        f"{group_words(group.group)} ({group.rejected:,})" for group in figures.groups if group.rejected
    ]
    if figures.critical_value is not None and counts:
        taken_back = figures.taken_back
        were = "was" if taken_back == 1 else "were"
        back = f"; {taken_back:,} that had been rejected {were} accepted again" if taken_back else ""
        yield (
            f"Rejected as gross errors: {', '.join(counts)} (|standardized residual| above "
            f"{figures.critical_value:g}){back}."
        )
        if figures.rejected_control:
            yield rejected_control_words(figures.rejected_control)
        if names := figures.given_up_points:
            yield (
                f"{_counted(len(names), 'object point was', 'object points were')} removed, because the "
                f"wrong one of {'its' if len(names) == 1 else 'their'} image points cannot be identified: "
                f"{some_names(names)}."
            )
    if figures.inseparable_control:
        yield _inseparable_words(figures)
    for group in figures.groups:
        if group.uncontrolled and group.group in _UNCONTROLLED:
            yield _uncontrolled_words(group, figures)


def _inseparable_words(figures: AdjustmentFigures) -> str:
    """Which control points contradict each other, and what was kept for it."""
    kept = ""
    if figures.unrejected_image_points:
        kept = (
            f" Image points with standardized residuals above {figures.critical_value:g} were therefore kept "
            f"({figures.unrejected_image_points:,}); those that are wrong are found once this is corrected."
        )
    return (
        "Control points contradict each other, and it cannot be determined which of "
        f"{some_names(figures.inseparable_control)} is wrong: an error of one explains what the others "
        f"contradict. None of them was rejected, so the error is in the result.{kept} Check their "
        "coordinates and their measurement in the images, or add control points or GNSS positions that "
        "separate them."
    )


def _uncontrolled_words(group: GroupFigure, figures: AdjustmentFigures) -> str:
    """How many coordinates nothing controls, which of control points, and what follows from it."""
    tested = figures.critical_value is not None
    (one, several), such_as = _UNCONTROLLED[group.group]
    it, was = ("it", "It was") if group.uncontrolled == 1 else ("them", "They were")
    words = (
        f"{_counted(group.uncontrolled, one, several)} (redundancy number below {UNCONTROLLED:g}, such as "
    )
    if group.group == "control_points":
        return (
            f"{words}{such_as}): {some_names(figures.uncontrolled_control)}. A gross error in {it} may "
            "remain undetected or resemble a tilt or scale of the control"
            f"{f'; {was.lower()} not tested for rejection' if tested else ''}."
        )
    not_tested = f" {was} not tested." if tested else ""
    return f"{words}{such_as}): a gross error in {it} would not be detected.{not_tested}"


def rejected_control_words(names: Sequence[str]) -> str:
    """Which control points were rejected."""
    return (
        f"Rejected control points: {some_names(names)}. They were not used as control; check their "
        "coordinates and their measurement in the images."
    )


def free_network_sentences(free: FreeNetworkFigure | None) -> Iterator[str]:
    """What the user should know about coordinates whose datum is that of approximate values."""
    if free is not None and free.defect == 0:
        yield (
            "A free network was requested (adjustment.datum), but the observations determine the whole "
            "datum: the result is an ordinary adjustment."
        )
    elif free is not None:
        number = "1 direction" if free.defect == 1 else f"{free.defect} directions"
        yield (
            f"Free network: the observations do not determine {number} of the datum "
            f"({', '.join(free.open)}). The approximate values of the {_CONSTRAINED[free.inner_constraints]} "
            "fix them (minimum norm of the corrections). In these directions, coordinates, differences at "
            "check points and their standard deviations have no meaning outside the block; residuals and "
            "redundancy numbers do not depend on them."
        )


def given_ground(figures: AdjustmentFigures) -> str:
    """What states where the block lies: ``control and GNSS``; empty: neither does."""
    groups = {group.group for group in figures.groups}
    words = (("control_points", "control"), ("gnss_positions", "GNSS"))
    return " and ".join(name for group, name in words if group in groups)


def registered_calibration_sentences(figures: AdjustmentFigures) -> Iterator[str]:
    """Which calibration of the registry does not fit the block."""
    ground = given_ground(figures)
    error = f"an error of its {ground.replace(' and ', ' or ')}, or σ" if ground else "σ"
    for item in figures.registered_calibrations:
        if item.contradicted:
            yield (
                f"The block contradicts the calibration of camera {item.camera} in the registry: T is "
                f"{item.statistic:.1f} with {item.freedom} degrees of freedom, a value exceeded by chance in "
                f"{100.0 * item.probability:.2g} % of all blocks. The camera or its mounting has changed, or "
                f"the block has {error} that are too small: find the cause, or recalibrate."
            )


def self_calibration_sentences(figures: AdjustmentFigures) -> Iterator[str]:
    """Which additional parameters the block does not determine."""
    lost = () if figures.self_calibration is None else figures.self_calibration.not_determinable
    if lost:
        names = ", ".join(dict.fromkeys(lost[:_MOST_PARAMETERS]))
        yield (
            f"{_counted(len(lost), 'additional parameter is', 'additional parameters are')} not determinable "
            f"in this block and {'was' if len(lost) == 1 else 'were'} removed: {names}"
            f"{' …' if len(lost) > _MOST_PARAMETERS else ''} (self_calibration.parquet lists the parameters "
            f"from which {'it' if len(lost) == 1 else 'each'} cannot be separated)."
        )


def without_effect_sentences(keys: Sequence[str]) -> Iterator[str]:
    """Settings of the adjustment that change nothing, and why."""
    for key in keys:
        yield f"adjustment.{key} has no effect on the adjustment: {_WITHOUT_EFFECT[key]}."


def shared_moment_sentences(shared: SharedMoments | None) -> Iterator[str]:
    """How images of one moment were taken: as events of a rig, or as readings that cameras share."""
    if shared is not None and shared.heads is not None and not shared.moments:
        yield (
            f"No two of the images of {shared.heads} heads belong to one event, based on their flights and "
            "times: each has a GNSS and INS observation of its own. If they were exposed together, correct "
            "the flights or times, or deliver their events; otherwise all σ are too small."
        )
    elif shared is not None and shared.heads is not None:
        yield (
            f"{shared.images:,} images of {shared.heads} heads were exposed at {shared.moments:,} events, "
            "based on their times: each has one position and attitude, and one GNSS and INS observation."
        )
    elif shared is not None:
        yield (
            f"{shared.images:,} images were exposed at {shared.moments:,} times by several heads: each GNSS "
            "and INS observation is used once, shared among them."
        )


def late_head_sentences(heads: Sequence[LateHeadFigure]) -> Iterator[str]:
    """Which heads were carried on a way that is not known well."""
    for item in heads:
        yield (
            f"The σ of the boresight is so large that it is not known to {item.sigma_m:.3f} m where the body "
            f"carried {item.head} in its {1e3 * item.offset_s:.3g} ms of synchronisation offset: "
            f"{item.part_of_sigma:.1g} times the σ of its projection centres, which does not contain it. "
            "Give the boresight a known value (adjustment.priors.boresight_deg), or deliver better attitudes."
        )


def trust_map_sentences(grid: TrustMapGrid | None) -> Iterator[str]:
    """That there is no trust map, though one was requested, or not of the whole area."""
    if grid is None:
        yield (
            "There is no trust map: the object points span no area that is covered by two images, or less "
            "than a cell (trust_map.cell_m), or a free network leaves the datum undetermined."
        )
    elif grid.unmapped:
        yield (
            f"{grid.unmapped:,} of the {grid.area_cells:,} cells of the area of the trust map "
            f"{'is' if grid.unmapped == 1 else 'are'} not mapped: fewer than two images see "
            f"{'it' if grid.unmapped == 1 else 'them'}, or there are no object points around. "
            f"{'It counts' if grid.unmapped == 1 else 'They count'} as exceeding every limit."
        )


def _counted(number: int, one: str, several: str) -> str:
    """A number with its words."""
    return f"{number:,} {one if number == 1 else several}"


def some_names(names: Sequence[str], most: int = _MOST_NAMES) -> str:
    """The first names, and how many more there are."""
    more = len(names) - most
    return f"{', '.join(names[:most])}{f' and {more:,} more' if more > 0 else ''}"
