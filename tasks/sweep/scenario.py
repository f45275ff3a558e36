"""A scenario of a sweep and its outcome."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import product

from pydantic import JsonValue

from tasks.errors import InputError, NotComputableError
from tasks.files.json_text import JSON
from tasks.settings.sweep import SweepSettings
from tasks.store.artifact import Artifact
from tasks.store.notes import read_notes
from tasks.store.store import Outputs


@dataclass(frozen=True)
class Scenario:
    """One combination of a sweep.

    Attributes
    ----------
    block, control, variant : names as in the project file.
    changes : settings the variant changes.
    """

    block: str
    control: str
    variant: str
    changes: Mapping[str, JsonValue]

    def __str__(self) -> str:
        return f"{self.block}, {self.control}, {self.variant}"


def scenarios(sweep: SweepSettings) -> tuple[Scenario, ...]:
    """Every combination, in the order of the project file."""
    changes = sweep.changes()
    names = product(sweep.blocks, sweep.control, changes)
    return tuple(Scenario(block, control, variant, changes[variant]) for block, control, variant in names)


@dataclass(frozen=True)
class Computed:
    """The outcome of a scenario, usable as an argument of a stage.

    Attributes
    ----------
    scenario : which one.
    artifacts : images, cameras and everything the adjustment wrote, by name; empty if there is no result.
    error : why there is none.
    """

    scenario: Scenario
    artifacts: Mapping[str, Artifact]
    error: InputError | NotComputableError | None = None

    @classmethod
    def of(
        cls, scenario: Scenario, outcomes: Iterable[Outputs | InputError | NotComputableError]
    ) -> Computed:
        """From the outcomes of the stages of a scenario in their order; the first error counts."""
        artifacts: Outputs = {}
        for outcome in outcomes:
            if isinstance(outcome, InputError | NotComputableError):
                return cls(scenario, {}, outcome)
            artifacts |= outcome
        return cls(scenario, artifacts)

    @property
    def status(self) -> str:
        """The status as in sweep.parquet."""
        if self.error is None:
            return "done"
        return "input_error" if isinstance(self.error, InputError) else "not_computable"

    @property
    def reason(self) -> str | None:
        """Why there is no result, in a sentence without paths; None if there is one."""
        if isinstance(self.error, InputError):
            return " ".join(part for part in (self.error.what, self.error.remedy) if part)
        return None if self.error is None else str(self.error)

    def key_content(self) -> JSON:
        """Names, settings, digests and reason: what the table depends on."""
        digests = {name: artifact.sha256 for name, artifact in sorted(self.artifacts.items())}
        scenario = self.scenario
        return {
            "scenario": [scenario.block, scenario.control, scenario.variant],
            "changes": dict(scenario.changes),
            "artifacts": digests,
            "status": self.status,
            "reason": self.reason,
        }

    def input_files(self) -> tuple[()]:
        """No delivered file."""
        return ()


def in_one_line(scenario: Scenario, outcome: Outputs | InputError | NotComputableError) -> str:
    """The result of an adjustment, for the progress on the screen."""
    if isinstance(outcome, InputError | NotComputableError):
        return f"{scenario}: {outcome}"
    sigma0_um = read_notes(outcome["notes"]).figures["sigma0_um"]
    return f"{scenario}: σ0 {sigma0_um:.3f} µm" if isinstance(sigma0_um, float) else f"{scenario}: no σ0"


def failures(computed: Iterable[Computed]) -> Iterator[str]:
    """A sentence for every scenario without a result."""
    for one in computed:
        if one.error is not None:
            yield f"{one.scenario}: {one.reason}"
