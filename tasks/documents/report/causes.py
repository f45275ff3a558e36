"""Where to look first: the strip, image or point behind each contradiction, one sentence for each.

From the tests of the model, from what was rejected besides image points, from images whose points do not
fit, from check points beyond their σ, and from suspicions that the delivery itself is wrong.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import pandas as pd
from scipy import special

from tasks.calibration.verdicts import REFUSED, RESTRICTED
from tasks.documents.report.material import IMAGE_POINTS, TOOK_PART, Material
from tasks.documents.report.surveyed_differences import AXES
from tasks.quantities import group_words, unit_words
from tasks.remarks.adjustment import (
    given_ground,
    global_test_words,
    misfit_words,
    rejected_control_words,
    some_names,
)
from tasks.remarks.independent_checks import check_survey_words
from tasks.results.figures import GroupFigure, ModelFinding

#: Places on the first screen; more are in the tables.
MOST_PLACES = 6
# Of calling any check point of a sound block wrong.
_ERROR_PROBABILITY = 0.005
# So many observations of a strip, and more than half of them, have one cause.
_SEVERAL = 3
# So many points of an image, and this part of them, do not fit by chance in no block.
_LEAST_POINTS, _LEAST_SHARE = 5, 0.2
# Beyond this a standardized residual is a gross error where nothing was rejected: 1 of 27,000 by chance.
_GROSS = 4.13
# Half of all standardized residuals are within this, if their σ are right.
_MEDIAN_OF_NORMAL = 0.6745
_OF_IMAGES = {"gnss_position": "gnss_positions", "ins_attitude": "ins_attitudes"}
_OF_ALL = {
    "angle_order": "the order of the angles",
    "convergence": "the north of the attitudes",
    "gnss_height_scale": "the heights of the GNSS positions",
    "refraction": "the correction of refraction",
    "time_offset": "the times of the exposures",
}
_ITS_OWN = {"gnss_positions": "GNSS position", "ins_attitudes": "INS attitude"}
_SINGLE = {**_OF_IMAGES, "control_point": "control_points"}
_GROUPS = {
    **_SINGLE,
    "gnss_shift": "gnss_positions",
    "gnss_drift": "gnss_positions",
    "boresight": "ins_attitudes",
    "ins_drift": "ins_attitudes",
}


@dataclass(frozen=True)
class Cause:
    """Something to look at.

    Attributes
    ----------
    place : ``strip E05``, ``image E06_003``, ``control point C038``; ``all`` of something.
    sentence : what is wrong there, and what to check.
    group : the observations in which it shows; empty: not known.
    images : those behind it; empty: it is of no images.
    points : the control or check point behind it, or those one of which it is.
    """

    place: str
    sentence: str
    group: str = ""
    images: frozenset[str] = frozenset()
    points: tuple[str, ...] = ()


def causes(material: Material) -> tuple[Cause, ...]:
    """The causes, the most likely first; nothing that one of them explains is named again."""
    found = [_of_finding(material, finding) for finding in material.figures.model_findings]
    found += [Cause("the delivery", sentence) for sentence in material.suspicions]
    for cause in chain(_rejected(material), _unfit_images(material), _check_points(material)):
        if not any(_explains(known, cause) for known in found):
            found.append(cause)
    return tuple(found)


def remarks(material: Material, found: Sequence[Cause]) -> tuple[str, ...]:
    """The problems of the run that verdict, causes and the section on the calibration do not mention."""
    calibration = material.figures.calibration
    against = (REFUSED, RESTRICTED)
    said = {cause.sentence for cause in found}
    sigma0, test = material.summary.sigma0, material.figures.global_test
    if sigma0 is not None and test is not None and test.lower is not None:
        said.add(global_test_words(sigma0, test))
    explained = {cause.group for cause in found}
    said |= {
        misfit_words(group) or ""
        for group in material.figures.groups
        if group.group in explained and not _misfits_as_a_whole(material, group)
    }
    said.add(rejected_control_words(_rejected_control(material)))
    others = (one for one in material.summary.problems if one not in said and not one.startswith(against))
    if calibration is None or calibration.verdict == "accepted":
        return tuple(others)
    return (f"The calibration is {calibration.verdict}: see the section System calibration.", *others)


def _misfits_as_a_whole(material: Material, group: GroupFigure) -> bool:
    """Whether most residuals of a group do not fit their σ, which no error of a few of them explains."""
    typical = max(1.0, _typical(material.residuals[material.residuals["group"] == group.group]))
    return misfit_words(group.model_copy(update={"sigma0": typical})) is not None


def _typical(table: pd.DataFrame) -> float:
    """σ of the standardized residuals, from their median size: a few gross errors do not change it."""
    size = table["standardized"][table["status"].isin(TOOK_PART)].abs()
    return float(size.median()) / _MEDIAN_OF_NORMAL


def _explains(known: Cause, cause: Cause) -> bool:
    """Whether a cause is the same as a known one, seen differently."""
    if known.place == cause.place:
        return True
    return bool(cause.images) and cause.images <= known.images and known.group in (cause.group, "")


def _of_finding(material: Material, finding: ModelFinding) -> Cause:
    group = _GROUPS.get(finding.quantity, "")
    if finding.quantity in _OF_IMAGES:
        return Cause(f"image {finding.entity}", finding.sentence, group, frozenset([finding.entity]))
    if finding.quantity == "control_point":
        points = _suspected(material, finding)
        place = (
            f"one of the control points {some_names(points)}" if points[1:] else f"control point {points[0]}"
        )
        return Cause(place, finding.sentence, group, points=points)
    if finding.scope != "all":
        place = f"{finding.scope} {finding.part}"
        images = material.oriented
        if finding.scope not in ("strip", "flight"):
            return Cause(f"the {place}", finding.sentence, group)
        own = images["image"][images[finding.scope] == finding.part]
        return Cause(place, finding.sentence, group, frozenset(own))
    if finding.quantity.startswith("control_"):
        return Cause("the control points", finding.sentence, "control_points")
    if finding.quantity in _OF_ALL:
        return Cause(_OF_ALL[finding.quantity], finding.sentence, group)
    if finding.entity in material.cameras:
        return Cause(f"camera {finding.entity}", finding.sentence, group)
    return Cause("all exposures", finding.sentence, group)


def _suspected(material: Material, finding: ModelFinding) -> tuple[str, ...]:
    """The control points one of which is wrong, as far as the block can tell."""
    inseparable = material.figures.inseparable_control
    others = inseparable if finding.entity in inseparable else ()
    return tuple(sorted({finding.entity, *finding.alike_points, *others}))


def _rejected(material: Material) -> Iterator[Cause]:
    """Strips and single observations that were rejected, image points apart, the largest |v|/σ first."""
    table = material.residuals
    if table.empty:
        return
    table = table[(table["group"] != IMAGE_POINTS) & (table["status"] != "not_used")]
    if not (table["status"] == "rejected").any():
        return
    table = table.assign(
        strip=material.strips_of(table["image"]),
        ratio=(table["residual"] / table["sigma"]).abs(),
        rejected=table["status"] == "rejected",
    )
    rejected = table[table["rejected"]].sort_values("ratio", ascending=False, kind="stable")
    of_strips = _rejected_strips(table)
    yield from of_strips.values()
    worst = rejected.drop_duplicates(["group", "image", "point"])
    alone = ~pd.MultiIndex.from_frame(worst[["group", "strip"]]).isin(list(of_strips))
    for row in worst[alone].to_dict("records"):
        yield _rejected_one(row)


def _rejected_strips(table: pd.DataFrame) -> dict[tuple[str, str], Cause]:
    """Strips of which most observations of a group were rejected, by group and strip."""
    images = table[table["strip"] != ""].groupby(["group", "strip", "image"])["rejected"].any()
    counted = images.groupby(["group", "strip"]).agg(["sum", "size"])
    many = counted[(counted["sum"] >= _SEVERAL) & (counted["sum"] > 0.5 * counted["size"])]
    found = {}
    for (group, strip), few, every in zip(many.index, many["sum"], many["size"], strict=True):
        own = table[(table["group"] == group) & (table["strip"] == strip)]
        sizes = own.groupby("component", sort=True)["residual"].median()
        unit = unit_words(str(own["unit"].iloc[0]))
        size = ", ".join(f"{name} {_signed(value, '.3g')}" for name, value in sizes.items())
        found[group, strip] = Cause(
            f"strip {strip}",
            f"{few} of its {every} {group_words(group)} were rejected; median of computed − given: "
            f"{size} {unit}. So many must have a common cause, such as their datum, base station or times.",
            group,
            frozenset(own["image"]),
        )
    return found


def _rejected_one(row: Mapping[Hashable, Any]) -> Cause:
    """A single observation that was rejected."""
    image, point = (row[name] if isinstance(row[name], str) else "" for name in ("image", "point"))
    group, unit = str(row["group"]), unit_words(str(row["unit"]))
    size = (
        f"computed − given {row['component']} {_signed(float(row['residual']), '.3g')} {unit}, "
        f"{float(row['ratio']):.1f} times its stated σ"
    )
    words = group_words(group)
    if group == "control_points":
        sentence = f"It was rejected and not used as control: {size}. Check its coordinates and its images."
        return Cause(f"control point {point}", sentence, group, points=(point,))
    if image:
        words = _ITS_OWN.get(group, words)
        sentence = f"Its {words} was rejected: {size}. Check its time and its solution."
        return Cause(f"image {image}", sentence, group, frozenset([image]))
    return Cause(f"point {point}" if point else words, f"Rejected: {size}.", group)


def _rejected_control(material: Material) -> list[str]:
    table = material.residuals
    if table.empty:
        return []
    own = table[(table["group"] == "control_points") & (table["status"] == "rejected")]
    return sorted(set(own["point"]))


def _unfit_images(material: Material) -> Iterator[Cause]:
    """Images of which many points were rejected or, where nothing was, do not fit."""
    table = material.residuals
    if table.empty:
        return
    tested = material.figures.critical_value is not None
    chosen = (table["group"] == IMAGE_POINTS) & table["status"].isin([*TOOK_PART, "rejected"])
    own = table.loc[chosen, ["image", "status", "standardized"]]
    # What all images have in common, such as σ that are too small, is no image's mistake.
    limit = _GROSS * np.fmax(1.0, _typical(own))
    bad = (own["status"] == "rejected") | (own["standardized"].abs() > limit)
    places, names = pd.factorize(own["image"], sort=True)
    # Two rows a point, one a component: a point is rejected with both, and seldom beyond a limit in both.
    count = np.bincount(places, minlength=len(names)) / 2.0
    unfit = np.bincount(places[bad.to_numpy()], minlength=len(names)) / (2.0 if tested else 1.0)
    unfit = np.minimum(unfit, count)
    share = np.divide(unfit, count, out=np.zeros(len(names)), where=count > 0)
    found = np.flatnonzero((unfit >= _LEAST_POINTS) & (share >= _LEAST_SHARE))
    for k in found[np.argsort(-share[found], kind="stable")].tolist():
        what = "were rejected" if tested else "have significant residuals"
        remedy = "" if tested else ", or reject gross errors (adjustment.rejection)"
        sentence = (
            f"{unfit[k]:.0f} of its {count[k]:.0f} image points {what}. Check whether its name, its "
            f"orientation and its image points belong together{remedy}."
        )
        yield Cause(f"image {names[k]}", sentence, IMAGE_POINTS, frozenset([str(names[k])]))


def _check_points(material: Material) -> Iterator[Cause]:
    """Check points farther from their given coordinates than their σ allow, if no finding moves them."""
    free, findings = material.figures.free_network, material.figures.model_findings
    if material.check_points.empty or (free is not None and free.defect):
        return
    # What a single observation moves is bounded, other findings may move every point.
    if any(finding.quantity not in _SINGLE for finding in findings):
        return
    moved_by = sum(_moved_by_at_most(material, finding) for finding in findings)
    table = material.differences(is_check=True)
    common = _common_shift(material, table)
    tests = int(table[[f"{axis}_ratio" for axis in AXES]].notna().to_numpy().sum())
    limit = special.ndtri(1.0 - 0.5 * _ERROR_PROBABILITY / max(tests, 1)) + moved_by
    if common:
        size = ", ".join(f"{axis} {_signed(shift, '.3f')} m" for axis, shift in common.items())
        sentence = (
            f"They differ alike: median of computed − given {size}. So many must have a common cause: "
            f"{check_survey_words(given_ground(material.figures))}."
        )
        yield Cause("the check points", sentence)
    d, sigma = (table[[p.format(axis) for axis in AXES]].to_numpy(np.float64) for p in ("{}_m", "sigma_{}_m"))
    own = np.abs(d - [common.get(axis, 0.0) for axis in AXES])
    own = np.divide(own, sigma, out=np.full(own.shape, np.nan), where=sigma > 0.0)
    largest = np.fmax.reduce(own, axis=1)
    far = np.flatnonzero(largest > limit)
    for k in far[np.argsort(-largest[far], kind="stable")].tolist():
        size = ", ".join(
            f"{axis} {_signed(d[k, i], '.3f')} m" for i, axis in enumerate(AXES) if own[k, i] > limit
        )
        rest = " in addition to what all have in common" if common else ""
        sentence = (
            f"Computed − given {size}, {largest[k]:.1f} times its σ{rest}. Check its coordinates and its "
            "measurement in the images."
        )
        point = str(table["point"].iloc[k])
        yield Cause(f"check point {point}", sentence, points=(point,))


def _signed(value: float, form: str) -> str:
    """A number with its sign, the minus being that of all tables of the page."""
    return f"{value:+{form}}".replace("-", "−")


def _moved_by_at_most(material: Material, finding: ModelFinding) -> float:
    """By how many of its σ a wrong observation moves an adjusted coordinate at most: t √((1 − r)/r).

    Its external reliability (Baarda 1968), for three components of the largest t.
    """
    table = material.residuals
    names = table["point" if finding.quantity == "control_point" else "image"]
    own = table[(table["group"] == _SINGLE[finding.quantity]) & (names == finding.entity)]
    r = float(own["redundancy"].min())
    return abs(finding.t) * np.sqrt(3.0 * max(1.0 - r, 0.0) / r) if r > 0.0 else np.inf


def _common_shift(material: Material, table: pd.DataFrame) -> dict[str, float]:
    """Median difference of the check points along each axis in which they differ alike, metres.

    That their mean is beyond its limit can be the error of one of them, which does not move the median.
    """
    test = material.summary.check_point_test
    if test is None:
        return {}
    found = {}
    for k, axis in enumerate(AXES):
        median, mean, limit = float(table[f"{axis}_m"].median()), test.mean_m[k], test.mean_limit_m[k]
        if test.points[k] < _SEVERAL or mean is None or limit is None:
            continue
        if min(abs(mean), abs(median)) > limit:
            found[axis] = median
    return found


def by_place(found: Sequence[Cause]) -> Mapping[str, tuple[str, ...]]:
    """What to report about each place, the most likely first."""
    places: dict[str, tuple[str, ...]] = {}
    for cause in found:
        places[cause.place] = (*places.get(cause.place, ()), cause.sentence)
    return places
