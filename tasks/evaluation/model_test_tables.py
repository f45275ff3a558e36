"""Tests of the model as tables: model_alternatives.parquet and model_alternative_effects.parquet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import special

from adjust.arrays import Bools, Floats
from adjust.model_tests import ModelTests
from adjust.parameters import Quantity
from adjust.quality.model_alternatives import AlternativeTests, ParameterAlternative
from tasks.evaluation.alternative import Alternative
from tasks.evaluation.alternative_words import CERTAIN, POWER, alike_words
from tasks.evaluation.result_tables import AdjustedBlock
from tasks.files.json_text import JSON
from tasks.quantities import reported_unit
from tasks.results.figures import RestoredGroup, StripScatter
from tasks.tables.parquet import write_stage_table
from tasks.tables.schemas.model_tests import MODEL_ALTERNATIVE_EFFECTS, MODEL_ALTERNATIVES

#: Probability that any alternative of a complete model is called significant, shared among all of them.
ERROR_PROBABILITY = 0.005
# How far an error that is just found moves a parameter, in σ: less and more count as much as these.
_GRAVITY = (1.0, 30.0)
# Of calling a scatter from strip to strip too large that is chance, of each quantity.
_SCATTER_PROBABILITY = 0.001
# Scores correlated by more than this cannot be separated from each other by chance; so many are named.
_ALIKE, _MOST_ALIKE = 0.7, 5
# By more than this, one explains nearly all that the other does.
_SAME = 0.9
# With fewer strips their scatter says nothing.
_FEW_STRIPS = 4
_DIVISIONS = ("flight", "height", "direction")
_KEY = ("quantity", "entity", "scope", "part")


@dataclass(frozen=True, eq=False)
class ExaminedModel:
    """The alternatives of an adjusted block and what was found.

    Attributes
    ----------
    alternatives, found : in the same order.
    """

    adjusted: AdjustedBlock
    alternatives: tuple[Alternative, ...]
    found: ModelTests

    @classmethod
    def of(
        cls, adjusted: AdjustedBlock, alternatives: Sequence[Alternative], found: ModelTests
    ) -> ExaminedModel:
        """Without those that change no observation: they are neither found nor missed."""
        acting = found.tests.acting
        tested = tuple(compress(alternatives, acting))
        return cls(adjusted, tested, replace(found, tests=found.tests.only(acting)))

    @property
    def scale(self) -> float:
        """Factor of all σ: σ0 where it is above 1; σ stated too large make nothing significant."""
        return max(1.0, self.adjusted.result.test.sigma0)

    @cached_property
    def critical(self) -> Floats:
        """(k,) |t| above which an alternative is significant.

        The probability of a false alarm is shared in proportion to how far an error that is just found would
        move a calibrated parameter, 1 to 30 σ (weighted Bonferroni; Genovese, Roeder and Wasserman 2006).
        Single errors have the critical value of their group.
        """
        own = np.array([np.nan if item.critical is None else item.critical for item in self.alternatives])
        tested = self.found.tests.distinguishable & np.isnan(own)
        alike = special.ndtri(1.0 - 0.5 * ERROR_PROBABILITY / max(int(tested.sum()), 1)) + POWER
        moved = np.abs(self._moved_sigmas).max(axis=0, initial=0.0) * self.found.tests.sigma * self.scale
        weight = np.where(tested, np.clip(alike * np.nan_to_num(moved), *_GRAVITY), 0.0)
        share = weight / max(weight.sum(), 1.0)
        shared = special.ndtri(1.0 - 0.5 * ERROR_PROBABILITY * np.where(tested, share, 1.0))
        return np.where(np.isnan(own), shared, own)

    @property
    def found_from(self) -> Floats:
        """(k,) size, in its σ, from which an alternative is significant with a probability of 80 %."""
        return self.critical + POWER

    @cached_property
    def order(self) -> tuple[int, ...]:
        """The alternatives that explain the misclosures, the most likely first."""
        least, most = (
            np.array([getattr(item, name) / item.factor for item in self.alternatives])
            for name in ("least", "most")
        )
        return possible_explanation(self.found.tests, self.critical * self.scale, least, most, self.scale)

    @cached_property
    def joint(self) -> tuple[float, Floats]:
        """How much of vᵀPv they explain together, and with which sizes."""
        return self.found.tests.joint(self.order) if self.order else (0.0, np.zeros(0))

    def figures(self) -> dict[str, JSON]:
        """For summary.json: how far they move a parameter together, and what they leave unexplained."""
        moved = np.abs(self._moved_sigmas[:, list(self.order)] @ self.joint[1])
        return {
            "moved_by_findings": float(moved.max(initial=0.0)),
            "strip_scatter": [
                item.to_json() for key in self._of_strips() if (item := self._scatter(*key)) is not None
            ],
            "restored_groups": [
                RestoredGroup(group=item.name, sigma0=item.sigma0(self.joint[0])).to_json()
                for item in self.found.restored
            ],
        }

    def _of_strips(self) -> list[tuple[str, str]]:
        """Quantities, with their entities, that may differ from strip to strip."""
        found = (item for item in self.alternatives if item.scope == "strip")
        return list(dict.fromkeys((item.quantity, item.entity) for item in found))

    def _scatter(self, quantity: str, entity: str) -> StripScatter | None:
        """By how much a quantity differs from strip to strip beyond its σ, if it does so significantly.

        An error of each strip moves what is common to k of them by 1/√k of it, which no σ says.
        """
        tests = self.found.tests
        members = [
            k
            for k, item in enumerate(self.alternatives)
            if (item.quantity, item.entity, item.scope) == (quantity, entity, "strip")
            and tests.distinguishable[k]
        ]
        if len(members) < _FEW_STRIPS:
            return None
        statistic, freedom = tests.together(members)
        statistic /= self.scale**2
        probability = float(special.chdtrc(freedom, statistic))
        if probability > _SCATTER_PROBABILITY:
            return None
        own = tests.estimate[members] ** 2 - (self.scale * tests.sigma[members]) ** 2
        scatter = float(np.sqrt(max(float(np.median(own)), own.mean(), 0.0)))
        every = self._moved_sigmas[:, members]
        factor = self.alternatives[members[0]].factor
        return StripScatter(
            quantity=quantity,
            entity=entity,
            unit=self.alternatives[members[0]].unit,
            strips=len(members),
            statistic=statistic,
            freedom=freedom,
            probability=probability,
            scatter=scatter * factor,
            moved_by=float(scatter * np.sqrt((every**2).sum(axis=1)).max(initial=0.0)),
        )

    def table(self) -> pd.DataFrame:
        """The rows of model_alternatives.parquet."""
        tests = self.found.tests
        factor = np.array([item.factor for item in self.alternatives])
        rank, explained = np.zeros(len(factor), dtype=np.int64), np.full(len(factor), np.nan)
        rank[list(self.order)] = np.arange(1, len(self.order) + 1)
        explained[list(self.order)] = self.joint[1]
        beside = np.full(len(factor), np.nan)
        if self.order:
            beside[list(self.order)] = tests.joint_sigma(self.order)
        moved = self._moved_sigmas
        most = np.argmax(np.abs(moved), axis=0) if len(moved) else np.zeros(len(factor), dtype=np.int64)
        by = moved[most, np.arange(len(factor))] if len(moved) else np.zeros(len(factor))
        names = [name for name, own in zip(self._names, self._calibrated(), strict=True) if own]
        size = np.where(rank > 0, explained, tests.estimate)
        return pd.DataFrame(
            {
                **{name: [getattr(item, name) for item in self.alternatives] for name in (*_KEY, "unit")},
                "estimate": tests.estimate * factor,
                "sigma": tests.sigma * self.scale * factor,
                "t": tests.t / self.scale,
                "detectable": self.found_from * tests.sigma * self.scale * factor,
                "rank": rank,
                "explained": explained * factor,
                "explained_sigma": beside * self.scale * factor,
                "alike": [self._alike(k) if rank[k] else None for k in range(len(factor))],
                "moves": [names[k].name if names else None for k in most],
                "moves_entity": [names[k].entity if names else None for k in most],
                "moved_by_detectable": np.abs(by) * self.found_from * tests.sigma * self.scale,
                "moved_by_estimate": np.abs(by * size),
            }
        )

    def _alike(self, k: int) -> str | None:
        """Other alternatives, not of other strips, that would look nearly the same, most similar first."""
        likeness = np.abs(np.nan_to_num(self.found.tests.correlation[k]))
        own = self.alternatives[k]
        others = [
            alike_words({name: getattr(item, name) for name in _KEY})
            for j in np.argsort(-likeness, kind="stable")
            for item in (self.alternatives[j],)
            if likeness[j] > _ALIKE and j != k
            if item.scope != "strip" or (own.scope, own.part) == (item.scope, item.part)
        ]
        return ", ".join(others[:_MOST_ALIKE]) or None

    def effects(self) -> pd.DataFrame:
        """The rows of model_alternative_effects.parquet."""
        own = np.flatnonzero(self._calibrated())
        names = [self._names[k] for k in own]
        effect = self.found.tests.effect[own] * self._units()[own, None]
        count = len(self.alternatives)
        columns: dict[str, Any] = {
            name: np.repeat([getattr(item, name) for item in self.alternatives], len(names))
            for name in (*_KEY, "unit")
        }
        return pd.DataFrame(
            columns
            | {
                "parameter": np.tile([name.name for name in names], count),
                "parameter_entity": np.tile([name.entity for name in names], count),
                "effect": (effect / [item.factor for item in self.alternatives]).T.reshape(-1),
            }
        )

    @cached_property
    def _moved_sigmas(self) -> Floats:
        """(h, k) change of the calibrated parameters by b = 1, in their standard deviations.

        A parameter that differs between flights, heights or directions has two values and one result: it is
        wrong by what it is moved for one of them, and by that less b for the other. The shift of a flight
        that is not in this part, or wholly, has one of both.
        """
        own = self._calibrated()
        spread = self.adjusted.sigma0 * np.sqrt(np.diagonal(self.adjusted.cofactor.reduced.corner)[own])
        effect = self.found.tests.effect[own].copy()
        names = [name for name, kept in zip(self._names, own, strict=True) if kept]
        for k, item in enumerate(self.alternatives):
            for row, of in enumerate(names):
                same = of.name == item.quantity and item.entity in ("", of.entity)
                if item.scope not in _DIVISIONS or not same:
                    continue
                inside = self._inside(item, of)
                larger = abs(effect[row, k] - 1.0) > abs(effect[row, k])
                if inside.any() and (larger or inside.all()):
                    effect[row, k] -= 1.0
        return effect / spread[:, None]

    def _inside(self, item: Alternative, of: Quantity) -> Bools:
        """(n,) which of the events that have a parameter are those for which it differs."""
        block, model = self.adjusted.block, item.model
        events = model.events if isinstance(model, ParameterAlternative) else None
        if events is None:
            return np.zeros(0, dtype=bool)
        own = np.array(block.flights, dtype=object)[block.flight_of_event] == of.flight
        return events if item.entity or of.flight is None else events[own]

    @cached_property
    def _names(self) -> tuple[Quantity, ...]:
        return self.adjusted.result.layout.border_quantities

    def _calibrated(self) -> Bools:
        """(g,) which columns of the border belong to a calibration: those random in a strip do not."""
        families = [
            item.family.entity_kind != "strip"
            for item in self.adjusted.result.layout.system
            for _ in range(int(item.free.sum()))
        ]
        return np.array(families, dtype=bool)

    def _units(self) -> Floats:
        """(g,) factors from SI and radians to the units of parameters.parquet."""
        factors = [
            reported_unit(item.family, int(component))[1]
            for item in self.adjusted.result.layout.system
            for _, component in np.argwhere(item.free)
        ]
        return np.array(factors, dtype=np.float64)


def possible_explanation(
    tests: AlternativeTests, critical: Floats, least: Floats, most: Floats, scale: float
) -> tuple[int, ...]:
    """The alternatives that explain the misclosures, without those whose size is none they could have.

    Where several look nearly the same, together they can take any size. What is impossible by itself stays,
    unless another one that is possible explains nearly the same, and so does a contradiction that nothing
    else explains: something is wrong.

    Parameters
    ----------
    critical : (k,) |t| above which an alternative is significant, with σ0 = 1.
    least, most : (k,) sizes below and beyond which it is no explanation; three times its σ are allowed.
    scale : factor of all σ.
    """
    critical, order = critical.copy(), tests.explanation(critical)
    impossible = _impossible(tests.estimate, scale * tests.sigma, least, most)
    possible = ~impossible & (np.abs(tests.t) > critical)
    replaced = (np.abs(np.nan_to_num(tests.correlation[:, possible])) > _SAME).any(axis=1)
    stays = impossible & ~replaced
    least, most = np.where(stays, 0.0, least), np.where(stays, np.inf, most)
    while order:
        own = list(order)
        size, sigma = tests.joint(order)[1], scale * tests.joint_sigma(order)
        none = _impossible(size, sigma, least[own], most[own])
        critical[np.array(order)[none]] = np.inf
        others = tests.explanation(critical) if none.any() else ()
        if not others:
            break
        order = others
    return order


def _impossible(size: Floats, sigma: Floats, least: Floats, most: Floats) -> Bools:
    """Which sizes (k,) are certainly below the least or beyond the largest possible one."""
    return np.asarray((np.abs(size) + CERTAIN * sigma < least) | (np.abs(size) - CERTAIN * sigma > most))


def write_model_alternatives(folder: Path, examined: ExaminedModel) -> None:
    """Write both tables."""
    for schema, rows in (
        (MODEL_ALTERNATIVES, examined.table()),
        (MODEL_ALTERNATIVE_EFFECTS, examined.effects()),
    ):
        write_stage_table(folder, schema, rows.reindex(columns=[column.name for column in schema.columns]))
