"""Which system parameters a block cannot separate, in words, and what would separate them."""

from __future__ import annotations

import numpy as np

from adjust.arrays import Floats
from adjust.parameters import Quantity
from tasks.evaluation.separability import listed, percent, separating

# Two parameters correlated by more than this are hardly separated; it is also 1 − λ of the weakest direction.
CORRELATED = 0.98
# Part of a direction (unit length) from which a parameter is named.
_INVOLVED = 0.3
_MOST_PAIRS, _MOST_MODES = 5, 3


def weak_mode_sentences(parameters: tuple[Quantity, ...], correlation: Floats) -> list[str]:
    """Sentences about pairs and about combinations of parameters that the block hardly separates.

    Parameters
    ----------
    correlation : (g, g) of the parameters.
    """
    if len(parameters) < 2:
        return []
    pairs = _pairs(correlation)
    sentences = [
        f"{parameters[a]} and {parameters[b]} are {percent(correlation[a, b])} correlated: "
        f"{_remedy((parameters[a].name, parameters[b].name), plural=False)}; "
        "their values must not be used separately."
        for a, b in pairs
    ]
    explained = {frozenset(pair) for pair in pairs}
    for members in _modes(correlation):
        if any(pair <= set(members) for pair in explained):
            continue
        named = [str(parameters[k]) for k in members]
        names = tuple(parameters[k].name for k in members)
        sentences.append(
            f"{', '.join(named[:-1])} and {named[-1]} are hardly determined individually, only in "
            f"combination: {_remedy(names, plural=True)}; their values must not be used separately."
        )
    return sentences


def _pairs(correlation: Floats) -> list[tuple[int, int]]:
    """The pairs that are correlated most, strongest first."""
    first, second = np.triu_indices(len(correlation), 1)
    size = np.abs(correlation[first, second])
    order = np.argsort(-size, kind="stable")[:_MOST_PAIRS]
    return [(int(first[k]), int(second[k])) for k in order if size[k] > CORRELATED]


def _modes(correlation: Floats) -> list[tuple[int, ...]]:
    """Parameters of the weakest directions of the correlation matrix, weakest direction first."""
    values, vectors = np.linalg.eigh(correlation)
    weak = [k for k in range(len(values)) if values[k] < 1.0 - CORRELATED][:_MOST_MODES]
    return [tuple(int(i) for i in np.flatnonzero(np.abs(vectors[:, k]) >= _INVOLVED)) for k in weak]


def _remedy(names: tuple[str, ...], plural: bool) -> str:
    """What would separate the parameters of these names."""
    found = separating(names)
    if not found:
        return "this block can hardly separate them; hold one of them fixed or give it a prior"
    remedies = listed(found)
    verb = "separate" if len(found) > 1 or remedies[-1] == "s" or remedies.endswith("alone") else "separates"
    hold = ", otherwise hold all but one of them fixed" if plural else ", otherwise hold one of them fixed"
    return f"{remedies} {verb} them{hold}"
