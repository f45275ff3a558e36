"""What can go wrong in an adjustment, in the terms of the field.

Every error carries the facts a program needs as attributes and says in its message what
happened, to which entity, and what to do about it.
"""

from __future__ import annotations

from dataclasses import dataclass

# Of what is not determined; of more, the first ones and their number.
_MOST_SENTENCES = 10


class AdjustmentError(Exception):
    """Base class of all errors of this package."""


@dataclass
class InconsistentBlockError(AdjustmentError):
    """The block contradicts itself: an index out of range, or an impossible shape or value."""

    message: str

    def __str__(self) -> str:
        return self.message


@dataclass
class DatumDefectError(AdjustmentError):
    """The normal equations are singular: some combination of unknowns is not determined.

    Attributes
    ----------
    defect : number of undetermined combinations.
    parameters : the unknowns that take the largest part in them, strongest first.
    explanation : plain sentences, one for each combination.
    of_block : whether a movement of the whole block is among them, which a free network would leave to
        the approximate values.
    """

    defect: int
    parameters: tuple[str, ...]
    explanation: tuple[str, ...]
    of_block: bool = False

    def __str__(self) -> str:
        # Of an orientation that is open altogether there are six.
        sentences = list(dict.fromkeys(self.explanation))
        more = len(sentences) - _MOST_SENTENCES
        return " ".join(
            (
                f"The normal equations have a rank defect of {self.defect}.",
                *sentences[:_MOST_SENTENCES],
                *([f"({more:,} more like these.)"] if more > 0 else []),
                "Add observations that determine them, or hold the named parameters fixed.",
                *(("In a free network, the approximate values fix movements of the whole block.",))
                * self.of_block,
            )
        )


@dataclass
class DivergenceError(AdjustmentError):
    """The iteration did not converge.

    Attributes
    ----------
    iterations : number of iterations that were tried.
    weighted_squares : vᵀPv of each of them, the approximate values first.
    largest : the unknown that still moves most, in words.
    weakest : the movement of the whole block that the observations hardly hold, with its σ; empty if none.
    """

    iterations: int
    weighted_squares: tuple[float, ...]
    largest: str
    weakest: str = ""

    def __str__(self) -> str:
        history = ", ".join(f"{value:.4g}" for value in self.weighted_squares)
        weakly = (
            f"The observations hardly hold the block in {self.weakest}, so far that equations cannot be "
            "linearised: add control points or positions that hold it, away from the line through the given "
            "ones, or check whether their σ are stated too large. "
        )
        return (
            f"No convergence after {self.iterations} iterations (vPv {history}). "
            f"The largest remaining change is at {self.largest}. "
            f"{weakly if self.weakest else ''}"
            "Check the approximate values, units and angle conventions of the input."
        )


@dataclass
class AdditionalParametersError(AdjustmentError):
    """Additional parameters that do not exist, are chosen twice, or do not fit the image.

    Attributes
    ----------
    what : what is wrong, a sentence.
    remedy : what to do about it, a sentence.
    """

    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.what} {self.remedy}"


@dataclass
class UnknownNameError(AdjustmentError, KeyError):
    """A name that is requested does not exist.

    Attributes
    ----------
    message : what was requested and what there is, sentences.
    known : the names that exist.
    """

    message: str
    known: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.message


@dataclass
class MissingExtraError(AdjustmentError, ImportError):
    """A library that belongs to an extra of the package is required but not installed.

    Attributes
    ----------
    what : what needs it, the beginning of a sentence.
    library : its name.
    extra : the extra of this package that brings it.
    """

    what: str
    library: str
    extra: str

    def __str__(self) -> str:
        return (
            f"{self.what} needs {self.library}, which is not installed. "
            f"Install it with: pip install 'aerocal[{self.extra}]'"
        )


@dataclass
class ExtensionError(AdjustmentError):
    """An extension that another package adds cannot be used.

    Attributes
    ----------
    extension : what it is and whose.
    what : what is wrong with it, a sentence without its subject.
    """

    extension: str
    what: str

    def __str__(self) -> str:
        return f"The extension {self.extension} {self.what}"
