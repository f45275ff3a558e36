"""Whether a block contradicts the calibrations of the registry that it uses: the test T, camera by camera."""

from __future__ import annotations

from dataclasses import dataclass

from adjust.observations.joint_prior import JointPrior
from adjust.quality.considered import contradiction_of_prior
from adjust.quality.considered_errors import Contradiction
from tasks.block.known_calibrations import KnownCalibration
from tasks.evaluation.result_tables import AdjustedBlock
from tasks.files.json_text import JSON
from tasks.results.figures import RegisteredCalibrationFigure

#: Probability below which T contradicts: one false alarm in a thousand cameras.
ERROR_PROBABILITY = 0.001


@dataclass(frozen=True)
class CameraContradiction:
    """T of the calibration of one camera.

    Attributes
    ----------
    known : the calibration.
    test : T with its degrees of freedom: what the block says of the calibrated parameters at all.
    """

    known: KnownCalibration
    test: Contradiction

    @property
    def contradicted(self) -> bool:
        """Whether block and calibration cannot both be right."""
        return self.test.probability < ERROR_PROBABILITY


def contradictions_of(
    adjusted: AdjustedBlock, known: tuple[KnownCalibration, ...]
) -> tuple[CameraContradiction, ...]:
    """T of every camera whose calibration is considered or observed."""
    result = adjusted.result
    considered = result.cofactor.considered
    found, first = [], 0
    for one in known:
        if not one.places:
            continue
        if not one.is_prior and considered is not None:
            members = range(first, first + len(one.places))
            first = members.stop
            found.append(CameraContradiction(one, considered.contradiction(members, adjusted.sigma0)))
    for item in result.groups:
        group = item.taking_part
        if isinstance(group, JointPrior):
            own = next(one for one in known if one.camera == group.source)
            test = contradiction_of_prior(
                group, result.state, result.layout, result.cofactor, adjusted.sigma0
            )
            found.append(CameraContradiction(own, test))
    return tuple(found)


def contradiction_figures(found: tuple[CameraContradiction, ...]) -> dict[str, JSON]:
    """For summary.json: every test, and the smallest probability, which a gate may limit."""
    return {
        "registered_calibrations": [
            RegisteredCalibrationFigure(
                camera=item.known.camera,
                use="prior" if item.known.is_prior else "consider",
                parameters=len(item.known.places),
                statistic=item.test.statistic,
                freedom=item.test.freedom,
                probability=item.test.probability,
                contradicted=item.contradicted,
            ).to_json()
            for item in found
        ],
        "registered_calibration": min((item.test.probability for item in found), default=None),
    }
