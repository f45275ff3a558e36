"""The text that selects additional parameters, such as ``bluh:1-12+42-73+81-88`` or ``legendre(5)``.

A selection is one item, or several joined by ``+``:

    SET                     all terms of a set                  brown
    SET(DEGREE)             the set of a degree                 legendre(5)
    SET:TERMS               some of its terms                   brown:K1,K2   legendre(5):1-12
    TERMS                   more terms of the set before it     bluh:1-12+42-73+81-88
    PRESET                  the text it stands for              bluh12+uc

TERMS are names and ranges of them, separated by commas; a range goes by the order of the set's terms.
``none`` selects nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches

from adjust.camera.additional.base import ParameterSet, SetByDegree
from adjust.errors import AdditionalParametersError

NOTHING = "none"
_ITEM = re.compile(r"(?P<name>\w[\w-]*)(?:\((?P<degree>\d+)\))?(?::(?P<terms>.+))?")
_CHOOSE_ONCE = "Name every additional parameter once."


@dataclass(frozen=True)
class Register:
    """Every set that can be selected, by name.

    Attributes
    ----------
    sets : those that are what they are.
    by_degree : those that come in degrees.
    presets : selections with a name of their own; they may name other presets.
    """

    sets: Mapping[str, ParameterSet]
    by_degree: Mapping[str, SetByDegree]
    presets: Mapping[str, str]

    @property
    def names(self) -> tuple[str, ...]:
        """Everything that an item may begin with."""
        return (*self.sets, *self.by_degree, *self.presets)


@dataclass(frozen=True)
class SelectedTerms:
    """Terms of one set, in the order in which they were selected."""

    set: ParameterSet
    names: tuple[str, ...]

    @property
    def title(self) -> str:
        """What was selected, for people: ``brown``, ``bluh:1–12``, ``brown:K1, P2``."""
        order = [term.name for term in self.set.terms]
        if list(self.names) == order:
            return self.set.name
        if len(self.names) == 1:
            return f"{self.set.name}:{self.names[0]}"
        first = order.index(self.names[0])
        if list(self.names) == order[first : first + len(self.names)]:
            return f"{self.set.name}:{self.names[0]}–{self.names[-1]}"
        return f"{self.set.name}:{', '.join(self.names)}"


def selected(text: str, register: Register) -> tuple[SelectedTerms, ...]:
    """The terms that a text selects, in its order; what follows each other in one set is one part.

    Raises
    ------
    AdditionalParametersError : if a name is not known, a degree is missing or not offered, or a parameter
        is selected twice or is a linear combination of others that are.
    """
    return joined(selected_items(text, register))


def selected_items(text: str, register: Register) -> tuple[SelectedTerms, ...]:
    """What ``selected`` gives, item by item as they are in the text: ``bluh:1-12+42-73`` has two.

    Raises
    ------
    AdditionalParametersError : as ``selected``.
    """
    if text.strip() == NOTHING:
        return ()
    result: list[SelectedTerms] = []
    for item in _items(text, register):
        before = result[-1].set if result else None
        result.append(_selected_by_item(item, before, register))
    _refuse_duplicates(result)
    _refuse_combinations(result)
    return tuple(result)


def joined(parts: Iterable[SelectedTerms]) -> tuple[SelectedTerms, ...]:
    """The same terms in the same order, parts of one set that follow each other as one."""
    result: list[SelectedTerms] = []
    for part in parts:
        if result and result[-1].set.name == part.set.name:
            result[-1] = SelectedTerms(part.set, (*result[-1].names, *part.names))
        else:
            result.append(part)
    return tuple(result)


def _items(text: str, register: Register) -> Iterable[str]:
    """The items of a text, presets replaced by those that they stand for."""
    for item in (part.strip() for part in text.split("+")):
        if item in register.presets:
            yield from _items(register.presets[item], register)
        else:
            yield item


def _selected_by_item(item: str, before: ParameterSet | None, register: Register) -> SelectedTerms:
    match = _ITEM.fullmatch(item)
    known = match is not None and match["name"] in (*register.sets, *register.by_degree)
    if match is not None and known:
        chosen = _set_of(match["name"], match["degree"], register)
        return SelectedTerms(chosen, _terms(chosen, match["terms"] or _all_of(chosen)))
    if before is not None and _looks_like_terms(item, before):
        return SelectedTerms(before, _terms(before, item))
    raise _unknown_item(item, before, register)


def _set_of(name: str, degree: str | None, register: Register) -> ParameterSet:
    """The set of a known name, of a degree where it comes in degrees."""
    if name in register.sets:
        if degree is None:
            return register.sets[name]
        raise AdditionalParametersError(
            f"The set '{name}' of additional parameters has no degree, but ({degree}) is given.",
            f"Write '{name}'.",
        )
    family = register.by_degree[name]
    if degree is not None and int(degree) in family.degrees:
        return family.of_degree(int(degree))
    given = "none is given" if degree is None else f"({degree}) is given"
    raise AdditionalParametersError(
        f"The set '{name}' of additional parameters comes in degrees {family.degrees[0]} to "
        f"{family.degrees[-1]}, but {given}.",
        f"Write '{name}({family.usual})', for example.",
    )


def _all_of(chosen: ParameterSet) -> str:
    return ",".join(term.name for term in chosen.terms)


def _terms(chosen: ParameterSet, text: str) -> tuple[str, ...]:
    """Names of the terms that names and ranges, separated by commas, select from a set."""
    order = [term.name for term in chosen.terms]
    names: list[str] = []
    for part in (piece.strip() for piece in text.split(",")):
        first, dash, last = (piece.strip() for piece in part.partition("-"))
        ends = (first, last) if dash else (first, first)
        for end in ends:
            if end not in order:
                raise _unknown_term(end, chosen)
        begin, end_place = (order.index(end) for end in ends)
        if begin > end_place:
            raise AdditionalParametersError(
                f"The range {part} of the set '{chosen.name}' of additional parameters runs backwards.",
                f"Write {last}-{first}.",
            )
        names += order[begin : end_place + 1]
    return tuple(names)


def _looks_like_terms(item: str, before: ParameterSet) -> bool:
    """Whether an item is meant as terms of the set before it: its first name is, or is a number."""
    first = re.split(r"[-,]", item)[0].strip()
    return first.isdecimal() or first in {term.name for term in before.terms}


def _refuse_duplicates(result: Iterable[SelectedTerms]) -> None:
    seen: set[tuple[str, str]] = set()
    degrees: dict[str, str] = {}
    for part in result:
        family = part.set.name.partition("(")[0]
        if degrees.setdefault(family, part.set.name) != part.set.name:
            raise AdditionalParametersError(
                f"{degrees[family]} and {part.set.name} are selected together.",
                f"Select one degree of '{family}'; the higher one contains the lower one.",
            )
        for name in part.names:
            if (part.set.name, name) in seen:
                raise AdditionalParametersError(
                    f"The additional parameter {part.set.name}:{name} is selected twice.", _CHOOSE_ONCE
                )
            seen.add((part.set.name, name))


def _refuse_combinations(result: Iterable[SelectedTerms]) -> None:
    names = {(part.set.name, name) for part in result for name in part.names}
    for chosen in {part.set.name: part.set for part in result}.values():
        for combination in chosen.combinations:
            if all((chosen.name, name) in names for name in (combination.term, *combination.of)):
                raise AdditionalParametersError(
                    f"The additional parameter {chosen.name}:{combination.term} is a linear combination of "
                    f"{chosen.name}:{','.join(combination.of)}, which are selected too: together they cannot "
                    "be determined.",
                    f"Leave {chosen.name}:{combination.term} out, or one of the others.",
                )


def _unknown_item(item: str, before: ParameterSet | None, register: Register) -> AdditionalParametersError:
    if not item:
        return AdditionalParametersError(
            "A selection of additional parameters has an empty item.", "Write names between the '+' signs."
        )
    name = re.split(r"[(:]", item)[0]
    if name in register.presets:
        return AdditionalParametersError(
            f"'{name}' stands for {register.presets[name]}, and takes neither a degree nor terms.",
            f"Write '{register.presets[name]}' with the terms wanted.",
        )
    terms = () if before is None else tuple(term.name for term in before.terms)
    what = f"There is no set '{item}' of additional parameters."
    if before is not None:
        what = f"'{item}' is neither a set of additional parameters nor a term of the set '{before.name}'."
    return AdditionalParametersError(what, _nearest(name, (*register.names, *terms)))


def _unknown_term(name: str, chosen: ParameterSet) -> AdditionalParametersError:
    return AdditionalParametersError(
        f"The set '{chosen.name}' of additional parameters has no term '{name}'.",
        _nearest(name, tuple(term.name for term in chosen.terms)),
    )


def _nearest(name: str, known: tuple[str, ...]) -> str:
    """A sentence that names the nearest known name, or all of them where none is near."""
    # Numbers that look alike are not near each other.
    near = [] if name.isdecimal() else get_close_matches(name, known, n=1, cutoff=0.5)
    if near:
        return f"Did you mean '{near[0]}'?"
    shown = ", ".join(known) if len(known) <= 12 else f"{', '.join(known[:5])} … {known[-1]}"
    return f"There are: {shown}."
