"""Every set of the register keeps the contracts, over every format; and sets that are wrong do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from adjust.arrays import Floats
from adjust.camera.additional.base import Basis, Combination, ImageFormat, ParameterSet, Term
from adjust.camera.additional.register import REGISTER
from tests.adjust.camera.additional import contracts
from tests.adjust.camera.additional.contracts import CONTRACTS, FORMATS, Contract
from tests.grids import pairs_daily

SETS = {
    **REGISTER.sets,
    **{
        f"{name}({family.usual})": family.of_degree(family.usual)
        for name, family in REGISTER.by_degree.items()
    },
}


@pytest.mark.parametrize(
    ("contract", "parameter_set", "image_format"),
    pairs_daily(CONTRACTS, list(SETS), list(FORMATS)),
    ids=lambda value: getattr(value, "__name__", value),
)
def test_the_set_keeps_the_contract(contract: Contract, parameter_set: str, image_format: str) -> None:
    contract(SETS[parameter_set], FORMATS[image_format])


@pytest.mark.parametrize("name", SETS)
def test_a_set_is_registered_under_its_own_name(name: str) -> None:
    assert SETS[name].name == name


@pytest.mark.parametrize("name", REGISTER.by_degree)
def test_every_degree_of_a_set_has_columns_for_all_its_terms(name: str) -> None:
    family = REGISTER.by_degree[name]
    assert family.usual in family.degrees
    for degree in (family.degrees[0], family.degrees[-1]):
        contracts.says_what_its_terms_are(family.of_degree(degree), FORMATS["UCE"])
        contracts.has_a_column_for_each_name(family.of_degree(degree), FORMATS["UCE"])


def _sound(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    """Two terms: x² in x, x y in y, as parts of the format; 1 µm in the corner."""
    u, v = xy[:, 0] / image_format.half_x, xy[:, 1] / image_format.half_y
    nothing = np.zeros_like(u)
    columns = {"A": (u * u, nothing), "B": (nothing, u * v)}
    return (
        np.stack([np.stack(columns[name], axis=1) for name in names], axis=2) * 1e-6
        if names
        else np.empty((len(xy), 2, 0))
    )


TERMS = (Term("A", "square", "µm", "published"), Term("B", "shear", "µm", "reconstructed"))
SOUND = ParameterSet("sound", "Sound", "this test", TERMS, _sound, formulas="A: Δx = u², B: Δy = u v")


def changed(change: Basis) -> ParameterSet:
    return replace(SOUND, basis=change)


def _unguarded(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    with np.errstate(invalid="ignore"):
        return _sound(xy, image_format, names) * (xy[:, 0] / np.hypot(*xy.T))[:, None, None]


def _about_the_mean(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    middle = xy.mean(axis=0) if len(xy) else 0.0
    return _sound(xy - middle, image_format, names)


def _own_order(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    return _sound(xy, image_format, tuple(sorted(names)))


def _one_function_for_both(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    return np.repeat(_sound(xy, image_format, ("A",)), len(names), axis=2) * np.arange(1.0, len(names) + 1)


def _nothing_for_the_second(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    return _sound(xy, image_format, names) * np.array([name == "A" for name in names])


def _in_steps(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    return _sound(np.floor(xy / 13e-6) * 13e-6, image_format, names)


def _far_too_large(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    """A wave of 5 µm: with a height of 5 µm its slope is above 1, and points fold over each other."""
    wave = np.sin(2.0 * np.pi * xy[:, 0] / 5e-6)[:, None, None]
    return _sound(xy, image_format, names) * wave


def _finer_than_the_slope_is_taken(xy: Floats, image_format: ImageFormat, names: tuple[str, ...]) -> Floats:
    """A wave of 5 nm."""
    wave = np.cos(2.0 * np.pi * xy[:, 0] / 5e-9)[:, None, None]
    return _sound(xy, image_format, names) * wave


BROKEN = {
    "names repeat": (replace(SOUND, terms=(TERMS[0], TERMS[0])), contracts.says_what_its_terms_are),
    "unit unknown": (
        replace(SOUND, terms=(TERMS[0], replace(TERMS[1], unit="furlong"))),
        contracts.says_what_its_terms_are,
    ),
    "unit missing": (
        replace(SOUND, terms=(TERMS[0], replace(TERMS[1], unit=""))),
        contracts.says_what_its_terms_are,
    ),
    "no meaning": (
        replace(SOUND, terms=(TERMS[0], replace(TERMS[1], meaning=" "))),
        contracts.says_what_its_terms_are,
    ),
    "no formulas": (replace(SOUND, formulas=""), contracts.says_what_its_terms_are),
    "a name with a sign of the grammar": (
        replace(SOUND, terms=(TERMS[0], replace(TERMS[1], name="B-1"))),
        contracts.says_what_its_terms_are,
    ),
    "axes exchanged": (
        changed(lambda xy, fmt, names: _sound(xy, fmt, names).transpose(0, 2, 1)[:, :1]),
        contracts.has_a_column_for_each_name,
    ),
    "an order of its own": (changed(_own_order), contracts.has_a_column_for_each_name),
    "relative to the mean of the points": (changed(_about_the_mean), contracts.takes_every_point_by_itself),
    "0/0 at the origin": (changed(_unguarded), contracts.is_finite_everywhere),
    "two terms alike": (changed(_one_function_for_both), contracts.has_full_rank),
    "a term without effect": (changed(_nothing_for_the_second), contracts.has_full_rank),
    "a combination that is none": (
        replace(SOUND, combinations=(Combination("B", of=("A",)),)),
        contracts.declares_true_combinations,
    ),
    "in steps": (changed(_in_steps), contracts.is_smooth_but_for_seams),
    "a slope that cannot be taken": (
        changed(_finer_than_the_slope_is_taken),
        contracts.enters_the_image_points_with_exact_derivatives,
    ),
    "points fold over": (changed(_far_too_large), contracts.leads_from_measured_to_ideal_and_back),
}


@pytest.mark.parametrize("contract", CONTRACTS, ids=lambda contract: contract.__name__)
def test_a_sound_set_keeps_the_contract(contract: Contract) -> None:
    contract(SOUND, FORMATS["UCE"])


@pytest.mark.parametrize(("parameter_set", "contract"), BROKEN.values(), ids=BROKEN)
def test_a_wrong_set_breaks_the_contract(parameter_set: ParameterSet, contract: Contract) -> None:
    with pytest.raises(AssertionError):
        contract(parameter_set, FORMATS["UCE"])


def test_every_contract_is_broken_by_some_wrong_set() -> None:
    assert {contract for _, contract in BROKEN.values()} == set(CONTRACTS)
