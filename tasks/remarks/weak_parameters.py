"""Which system parameters a block cannot separate, in words, and what would separate them."""

from __future__ import annotations

from collections.abc import Collection

from tasks.quantities import kind_of, named
from tasks.remarks.separability import listed, percent, separating
from tasks.results.figures import WeakParameters


def weak_parameter_sentences(
    found: tuple[WeakParameters, ...], determined: Collection[tuple[str, str]] = ()
) -> list[str]:
    """Sentences about groups and combinations of parameters that the block hardly separates.

    Parameters
    ----------
    determined : names and entities of those that a calibration calls determined. Groups of them are named by
        its verdict, with the certified covariances: `correlation_sentence`.
    """
    sentences = []
    for item in found:
        if not set(zip(item.parameters, item.entities, strict=True)) <= set(determined):
            sentences.append(_not_separated(item))
        elif item.correlation is None:
            together = _although_determined(len(item.parameters))
            sentences.append(f"{_members(item)} are correlated in combination, {together}")
    return sentences


def correlation_sentence(members: Collection[str], correlation: float) -> str:
    """That members of a group are correlated by up to this, although a calibration calls them determined."""
    how_much = _how_much(len(members), correlation)
    return f"{listed(members)} are {how_much} correlated, {_although_determined(len(members))}"


def _although_determined(members: int) -> str:
    """What follows for values of which each is determined, but with the errors of others."""
    return f"although {'both' if members == 2 else 'all'} are determined: use their values together only."


def _not_separated(weak: WeakParameters) -> str:
    how = "hardly determined individually, only in combination"
    if weak.correlation is not None:
        how = f"{_how_much(len(weak.parameters), weak.correlation)} correlated"
    return (
        f"{_members(weak)} are {how}: {_remedy(weak.parameters)}; their values must not be used separately."
    )


def _members(weak: WeakParameters) -> str:
    return listed([*map(named, weak.parameters, weak.entities)])


def _how_much(members: int, correlation: float) -> str:
    return percent(correlation) if members == 2 else f"up to {percent(correlation)}"


def _remedy(names: tuple[str, ...]) -> str:
    """What would separate the parameters of these names."""
    if len(set(names)) == 1 and kind_of(names[0]) == "relative_rotation":
        return "what the heads have in common is determined less well than their rotations against each other"
    found = separating(names)
    if not found:
        return "this block can hardly separate them; hold one of them fixed or give it a prior"
    remedies = listed(found)
    verb = "separate" if len(found) > 1 or remedies[-1] == "s" or remedies.endswith("alone") else "separates"
    hold = "all but one" if len(names) > 2 else "one"
    return f"{remedies} {verb} them, otherwise hold {hold} of them fixed"
