"""The text that selects additional parameters."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.register import REGISTER, additional_parameters
from adjust.camera.additional.selection import selected, selected_items
from adjust.errors import AdditionalParametersError

UCE = ImageFormat(34.008e-3, 52.026e-3)


def names(text: str) -> tuple[str, ...]:
    return additional_parameters(text, UCE).names


def numbers(*ranges: tuple[int, int]) -> tuple[str, ...]:
    return tuple(f"bluh:{number}" for first, last in ranges for number in range(first, last + 1))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("bluh:7", numbers((7, 7))),
        ("bluh:1-12", numbers((1, 12))),
        ("bluh:1-12+42-73+81-88", numbers((1, 12), (42, 73), (81, 88))),
        ("bluh:1-3,9+88", numbers((1, 3), (9, 9), (88, 88))),
        (" bluh:1 - 3 , 9 + 88 ", numbers((1, 3), (9, 9), (88, 88))),
        ("bluh:12-29", ("bluh:12", "bluh:29")),
        ("brown:K1,P1-B1", ("brown:K1", "brown:P1", "brown:P2", "brown:B1")),
        ("brown:K1+bluh:81+83", ("brown:K1", "bluh:81", "bluh:83")),
        ("legendre(3):1-2", ("legendre(3):1", "legendre(3):2")),
        ("legendre(2)+brown:K1", (*(f"legendre(2):{i}" for i in range(1, 13)), "brown:K1")),
        ("none", ()),
    ],
)
def test_a_text_selects_terms_in_its_order(text: str, expected: tuple[str, ...]) -> None:
    assert names(text) == expected


@pytest.mark.parametrize(
    ("preset", "same"),
    [
        ("bluh12", "bluh:1-12"),
        ("uc", "bluh:42-73"),
        ("bluh12+uc", "bluh:1-12+42-73"),
        ("uc+corner", "bluh:42-73+81-88"),
        ("bluh12+uc+corner", "bluh:1-12+42-73+81-88"),
        ("bluh12+corner", "bluh:1-12+81-88"),
        ("bluh12+79+80", "bluh:1-12+79+80"),
        ("dmc", "bluh:1-12+34-41+80"),
        ("jacobsen_radial", "bluh:9-11"),
    ],
)
def test_a_preset_stands_for_its_text(preset: str, same: str) -> None:
    assert names(preset) == names(same)


@pytest.mark.parametrize("preset", REGISTER.presets)
def test_every_preset_selects_something_and_has_no_name_of_a_set(preset: str) -> None:
    assert selected(preset, REGISTER)
    assert preset not in {*REGISTER.sets, *REGISTER.by_degree, "none"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("bluhh", "no set 'bluhh' of additional parameters. Did you mean 'bluh'"),
        ("borwn", "no set 'borwn' of additional parameters. Did you mean 'brown'"),
        ("borwn:K1", "Did you mean 'brown'"),
        ("brown:K7", "'brown' of additional parameters has no term 'K7'. Did you mean 'K"),
        ("bluh:13", "has no term '13'. There are: 1, 2, 3, 4, 5 … 88"),
        ("bluh:1-12+20-30", "has no term '20'"),
        ("bluh:1-12+lengendre(5)", "neither a set of additional parameters nor a term of the set 'bluh'"),
        ("1-12", "no set '1-12'"),
        ("bluh:5-1", "runs backwards. Write 1-5"),
        ("bluh:1-12+7", "bluh:7 is selected twice"),
        ("bluh:1,1", "bluh:1 is selected twice"),
        ("bluh12+bluh:12", "bluh:12 is selected twice"),
        ("legendre", "comes in degrees 2 to 10, but none is given. Write 'legendre.5.'"),
        ("legendre(99)", r"comes in degrees 2 to 10, but \(99\) is given"),
        ("legendre(2)+legendre(3)", r"legendre\(2\) and legendre\(3\) are selected together"),
        ("brown(3)", r"'brown' of additional parameters has no degree, but \(3\) is given. Write 'brown'"),
        ("bluh12:1", "'bluh12' stands for bluh:1-12, and takes neither a degree nor terms"),
        ("bluh:1-12+", "has an empty item"),
        ("", "has an empty item"),
        ("none+bluh12", "no set 'none'"),
        ("dmc+79", "bluh:79 is a linear combination of bluh:34,35,36,37,38,39,40,41, which are selected too"),
        ("bluh:2,29-33", "bluh:33 is a linear combination"),
        ("bluh", "is a linear combination"),
    ],
)
def test_a_wrong_text_is_refused_with_what_to_do(text: str, message: str) -> None:
    with pytest.raises(AdditionalParametersError, match=message) as caught:
        names(text)
    assert caught.value.what.endswith(".")
    assert caught.value.remedy[-1] in ".?"
    assert str(caught.value) == f"{caught.value.what} {caught.value.remedy}"


_ORDER = [term.name for term in REGISTER.sets["brown"].terms]


@given(st.lists(st.sampled_from(_ORDER), min_size=1, unique=True), st.data())
def test_any_grouping_of_the_same_names_selects_the_same(chosen: list[str], data: st.DataObject) -> None:
    signs = [data.draw(st.sampled_from([",", "+", "+brown:"])) for _ in chosen[1:]]
    text = "brown:" + chosen[0] + "".join(sign + name for sign, name in zip(signs, chosen[1:], strict=True))
    assert names(text) == tuple(f"brown:{name}" for name in chosen)


@given(st.text(alphabet="bluhrown:+-,()0123456789K ", max_size=25))
def test_any_text_selects_something_or_is_refused(text: str) -> None:
    try:
        chosen = selected(text, REGISTER)
    except AdditionalParametersError:
        return
    assert all(part.names for part in chosen)


def test_terms_of_one_set_that_follow_each_other_are_evaluated_together() -> None:
    parts = selected("bluh12+uc+bluh:81+brown:K1+K2+bluh:82", REGISTER)
    assert [(part.set.name, len(part.names)) for part in parts] == [("bluh", 45), ("brown", 2), ("bluh", 1)]


def test_known_parameters_come_after_the_selected_ones_and_may_be_combinations_of_them() -> None:
    parameters = additional_parameters("bluh:34-41", UCE, known=("bluh:79", "legendre(2):5", "legendre(3):7"))
    assert parameters.names[8:] == ("bluh:79", "legendre(2):5", "legendre(3):7")
    with pytest.raises(AdditionalParametersError, match="has no term 'K9'"):
        additional_parameters("none", UCE, known=("brown:K9",))


def test_units_and_terms_are_those_of_the_sets() -> None:
    parameters = additional_parameters("bluh:1,7,9+81+brown:K2", UCE)
    assert parameters.units == ("1", "1/mm", "1/mm²", "mm", "1/m⁴")
    assert [(set_name, term.name) for set_name, term in parameters.terms][-1] == ("brown", "K2")


@pytest.mark.parametrize(
    ("text", "titles"),
    [
        ("none", ()),
        ("bluh:1-12+42-73", ("bluh:1–12", "bluh:42–73")),
        ("brown+bluh:81", ("brown", "bluh:81")),
        ("brown:K1,P2+bluh12", ("brown:K1, P2", "bluh:1–12")),
        ("legendre(5)", ("legendre(5)",)),
    ],
)
def test_the_items_of_a_text_have_titles(text: str, titles: tuple[str, ...]) -> None:
    assert tuple(item.title for item in selected_items(text, REGISTER)) == titles
