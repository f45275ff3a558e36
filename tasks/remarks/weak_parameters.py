"""Which system parameters a block cannot separate, in words, and what would separate them."""

from __future__ import annotations

from tasks.quantities import named
from tasks.remarks.separability import listed, percent, separating
from tasks.results.figures import WeakParameters


def weak_parameter_sentences(found: tuple[WeakParameters, ...]) -> list[str]:
    """Sentences about pairs and about combinations of parameters that the block hardly separates."""
    return [_of_pair(item) if item.correlation is not None else _of_combination(item) for item in found]


def _of_pair(pair: WeakParameters) -> str:
    first, second = map(named, pair.parameters, pair.entities)
    return (
        f"{first} and {second} are {percent(pair.correlation or 0.0)} correlated: "
        f"{_remedy(pair.parameters, plural=False)}; their values must not be used separately."
    )


def _of_combination(members: WeakParameters) -> str:
    *others, last = map(named, members.parameters, members.entities)
    return (
        f"{', '.join(others)} and {last} are hardly determined individually, only in combination: "
        f"{_remedy(members.parameters, plural=True)}; their values must not be used separately."
    )


def _remedy(names: tuple[str, ...], plural: bool) -> str:
    """What would separate the parameters of these names."""
    found = separating(names)
    if not found:
        return "this block can hardly separate them; hold one of them fixed or give it a prior"
    remedies = listed(found)
    verb = "separate" if len(found) > 1 or remedies[-1] == "s" or remedies.endswith("alone") else "separates"
    hold = ", otherwise hold all but one of them fixed" if plural else ", otherwise hold one of them fixed"
    return f"{remedies} {verb} them{hold}"
