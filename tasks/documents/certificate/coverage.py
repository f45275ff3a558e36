"""Expanded uncertainty of a calibrated value: U = k σ (JCGM 100:2008, 6.2 and annex G).

k is the two-sided quantile of Student's t with the degrees of freedom of the σ. They are the redundancy of
the adjustment where σ0 is taken from the residuals, and without limit where the stated σ are trusted.
What was held is known with a stated σ and would add to them; leaving that out errs on the safe side.
"""

from __future__ import annotations

from dataclasses import dataclass

from scipy import special

from tasks.documents.certificate.material import CertificateMaterial

#: Part of the values that an interval ± U is to hold.
COVERAGE = 0.95


@dataclass(frozen=True)
class CoverageFactor:
    """The factor and its basis; ``freedom`` is None for infinitely many degrees of freedom."""

    k: float
    freedom: int | None

    @property
    def words(self) -> str:
        """How U is to be read, in a sentence."""
        of = (
            "the normal distribution (the stated σ are taken as known)"
            if self.freedom is None
            else f"Student's t with {self.freedom:,} degrees of freedom"
        )
        return (
            f"U = k σ: expanded uncertainty with the coverage factor k = {self.k:.2f} of {of}; the interval "
            f"value ± U contains the true value with a probability of about {100 * COVERAGE:g} % if the "
            "model is correct (JCGM 100:2008, GUM)."
        )


def coverage_factor(freedom: int | None) -> CoverageFactor:
    """The factor for so many degrees of freedom; None: without limit."""
    quantile = 0.5 * (1.0 + COVERAGE)
    if freedom is None or freedom < 1:
        return CoverageFactor(float(special.ndtri(quantile)), None)
    return CoverageFactor(float(special.stdtrit(freedom, quantile)), freedom)


def coverage_of(material: CertificateMaterial) -> CoverageFactor:
    """The factor of all parameters of a record."""
    trusted = material.results.project.adjustment.sigma0 == "a_priori"
    return coverage_factor(None if trusted else material.record.redundancy)
