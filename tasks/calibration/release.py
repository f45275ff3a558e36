"""Staged release of the parameters of a one-step calibration.

A parameter that the flight does not determine spoils the others unnoticed: its value drifts along the weak
direction, and correlated parameters with it. Therefore the parameters are released in stages: first mounting
and GNSS, then the interior orientation, then the additional parameters. After each stage the estimates are
judged, and what was not determined is held from then on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias, cast

from adjust.camera.additional.selection import NOTHING
from adjust.parameters import INTERIOR_ORIENTATION
from tasks.files.json_text import JSON
from tasks.quantities import KINDS
from tasks.settings.adjustment import AdjustmentSettings, FreeParameter
from tasks.settings.calibration import CalibrationSettings
from tasks.settings.direct_georeferencing import CalibrationInput
from tasks.settings.project import Project
from tasks.store.artifact import Artifact
from tasks.store.notes import read_notes

#: Families that are held because the flight does not determine them → the reason, a sentence.
Held: TypeAlias = Mapping[str, str]
#: Figure in which a judgement says which families are held, and why.
HELD = "held"
#: Figure that names all families that were not determined.
UNDETERMINED = "undetermined"
#: Name under which all additional parameters are held together.
ADDITIONAL = "additional_parameters"
_INTERIOR = tuple(name for name, kind in KINDS.items() if kind.family == INTERIOR_ORIENTATION)


@dataclass(frozen=True)
class Release:
    """What is free at one stage of the calibration.

    Attributes
    ----------
    before : families that are free since an earlier stage.
    new : families that this stage releases.
    additional : selection of additional parameters that this stage releases.
    """

    before: tuple[FreeParameter, ...]
    new: tuple[FreeParameter, ...]
    additional: str = NOTHING

    @property
    def free(self) -> tuple[FreeParameter, ...]:
        """All families that are free."""
        return self.before + self.new

    @property
    def newly_released(self) -> tuple[str, ...]:
        """What was held until now."""
        return self.new if self.additional == NOTHING else (*self.new, ADDITIONAL)

    def applied_to(self, project: Project) -> Project:
        """The project with an adjustment of this release, whose result is the calibration that is checked."""
        own = project.adjustment.self_calibration.model_copy(update={"parameters": self.additional})
        adjustment = project.adjustment.model_copy(update={"free": self.free, "self_calibration": own})
        direct = project.direct_georeferencing.model_copy(
            update={"calibration": CalibrationInput(adjustment=True)}
        )
        return project.model_copy(update={"adjustment": adjustment, "direct_georeferencing": direct})

    def told(self, held: Held) -> JSON:
        """What was free, and what is held fixed afterwards, for summary.json."""
        return {"free": list(self.free), "additional": self.additional, HELD: dict(held)}

    def without(self, held: Held) -> Release:
        """The same release without what is held."""
        return replace(
            self,
            before=tuple(name for name in self.before if name not in held),
            new=tuple(name for name in self.new if name not in held),
            additional=NOTHING if ADDITIONAL in held else self.additional,
        )


def releases(calibration: CalibrationSettings, adjustment: AdjustmentSettings) -> tuple[Release, ...]:
    """The stages, each with everything that is free in it; the last one is the goal."""
    outer = tuple(name for name in calibration.free if name not in _INTERIOR)
    interior = tuple(name for name in calibration.free if name in _INTERIOR)
    stages = [Release((), outer)]
    if interior:
        stages.append(Release(outer, interior))
    if adjustment.self_calibration.parameters != NOTHING:
        stages.append(Release(outer + interior, (), adjustment.self_calibration.parameters))
    return tuple(stages)


@dataclass(frozen=True)
class Undetermined:
    """What a flight does not determine after a release: family → the reason, as a sentence.

    Attributes
    ----------
    all : families whose σ is too large to be a result.
    inseparable : those of them about which the flight has no information.
    before : names of those that were not determined before this release either.
    """

    all: Held
    inseparable: frozenset[str] = frozenset()
    before: frozenset[str] = frozenset()

    def to_be_held(self, release: Release) -> Held:
        """What is held from now on.

        Of mounting and GNSS only what cannot be separated from the rest: to hold what is merely weak, at a
        value that nobody knows, would make everything else look better than it is. Of interior orientation
        and additional parameters everything that was not determined: their given values are known. If they
        have spoilt others, they are held for that.
        """
        inseparable = {name: reason for name, reason in self.all.items() if name in self.inseparable}
        if not release.before:
            return inseparable
        new = {name: reason for name, reason in self.all.items() if name in release.newly_released}
        if new:
            return new
        spoilt = [
            reason for name, reason in self.all.items() if name in release.before and name not in self.before
        ]
        if not spoilt:
            return inseparable
        why = f"If it is estimated, other parameters become undetermined: {' '.join(spoilt)}"
        return dict.fromkeys(release.newly_released, why) or inseparable


def held_after(judgement: Artifact) -> Held:
    """What is held after a judgement, with the reasons."""
    return cast(Held, read_notes(judgement).figures.get(HELD, {}))


def undetermined_after(judgement: Artifact) -> tuple[str, ...]:
    """Families that a release has not determined, whether they are held or not."""
    return tuple(cast("Sequence[str]", read_notes(judgement).figures[UNDETERMINED]))
