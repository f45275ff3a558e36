"""Mean residuals as corrections: what one pass leaves, and what one flight can do for another.

An UltraCam X with radial errors of 2.5 µm and CCD images shifted by 0.8 µm flies high (20 cm) with GNSS and
low (8 cm) without, nine control points each. Prints σ0, the RMS of the heights at the check points, how many
corrections were made, and which part of vᵀPv they take from images that had no part in them:

    high: no correction            σ0 1.410   Z 0.324 m
    high: plain means, once        σ0 1.052   Z 0.172 m
    high: plain means, 5 times     σ0 0.996   Z 0.047 m
    high: validated, not smoothed  σ0 1.013   Z 0.108 m   2 ×   39.2 %
    high: validated, smoothed      σ0 1.012   Z 0.053 m   5 ×   43.3 %
    high: the same with seams      σ0 0.997   Z 0.064 m   4 ×   44.9 %
    high: 9 × 9 with seams         σ0 1.005   Z 0.046 m   8 ×   45.2 %
    high: collocation, 15 × 15     σ0 1.017   Z 0.035 m   3 ×   43.1 %
    low: no correction             σ0 1.263   Z 0.198 m
    low: validated, smoothed       σ0 1.007   Z 0.136 m   6 ×   33.9 %
    low: collocation, 15 × 15      σ0 1.013   Z 0.027 m   3 ×   32.5 %
    low: grid of the high flight   σ0 1.004   Z 0.036 m
    mean residuals of both flights: correlation 0.75 in x, 0.81 in y; 28 % of the sub-areas differ
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from adjust import AdjustmentResult, Block, FrameCamera, Observations, adjust_block
from adjust.parameters import State
from adjust.residual_grid.collocation import collocate
from adjust.residual_grid.comparison import compare_grids
from adjust.residual_grid.controlled_residuals import controlled
from adjust.residual_grid.format_cells import FormatCells, Seams
from adjust.residual_grid.image_correction import CorrectionField, corrected
from adjust.residual_grid.image_sets import GridRule
from adjust.residual_grid.iteration import GridIteration, iterate_grid
from adjust.residual_grid.residual_grid import residual_grid
from adjust.residual_grid.smoothing import Smoothing
from adjust.simulate.block import SimulatedBlock, simulate_block
from adjust.simulate.flight_plan import LineGroup, base_of, spacing_of
from adjust.simulate.image_errors import ImageErrorSpecification
from adjust.simulate.noise import NoiseSpecification
from adjust.simulate.object_points import PointSpecification
from adjust.simulate.survey import SurveyLayout
from adjust.simulate.terrain import TerrainShape
from adjust.simulate.truth import BlockSpecification

CAMERA = FrameCamera("UCX", 9420, 14430, 7.2e-6, 0.1005, (0.0, 0.0), "corner", 0)
ERRORS = ImageErrorSpecification(radial=2.5e-6, tile_shift=0.8e-6)
THIRDS = Seams(*((-half / 3.0, half / 3.0) for half in CAMERA.half_format))


def flight(height: float, lines: tuple[int, int], cross: tuple[int, int], noise_seed: int) -> SimulatedBlock:
    """Lines of so many exposures to the east, and cross lines to the north."""
    base, spacing = base_of(CAMERA, height, 0.7), spacing_of(CAMERA, height, 0.7)
    specification = BlockSpecification(
        cameras=(CAMERA,),
        flight=(
            LineGroup("E", "1", 0, np.pi / 2, height, (lines[1],) * lines[0], base, spacing),
            LineGroup("N", "1", 0, 0.0, height, (cross[1],) * cross[0], base, 3 * spacing),
        ),
        points=PointSpecification(count=1500),
        noise=NoiseSpecification(0.8e-6, (0.02, 0.02, 0.03), (0.05, 0.05, 0.07), (1e-4, 1e-4, 2e-4)),
        survey=(SurveyLayout("grid", columns=10, rows=11, control=9),),
        terrain=TerrainShape(mean=300.0, relief=30.0),
        image_errors=ERRORS,
        seed=3,  # decides what the errors of the camera look like
    )
    return simulate_block(specification).measured_again(noise_seed)


def heights(simulated: SimulatedBlock, state: State) -> float:
    """RMS of the heights at the check points, metres."""
    points = simulated.truth.surveyed[simulated.truth.is_check]
    difference = state.object_point[points] - simulated.truth.state.object_point[points]
    return float(np.sqrt(np.mean(difference[:, 2] ** 2)))


def show(words: str, sigma0: float, z: float, found: GridIteration | None = None) -> None:
    """One line of what is printed."""
    more = "" if found is None else f"   {found.taken} ×   {100 * found.gain:.1f} %"
    print(f"{words:30} σ0 {sigma0:.3f}   Z {z:.3f} m{more}")


def with_fields(
    block: Block, observations: Observations, fields: tuple[CorrectionField | None, ...]
) -> AdjustmentResult:
    """The block adjusted with these corrections."""
    rays = corrected(observations.image_points, fields, block.camera_of_image, "bilinear")
    return adjust_block(block, replace(observations, image_points=rays))


def main() -> None:
    """The high flight with different corrections; then the best of them in the low flight."""
    high = flight(2875.0, (5, 8), (2, 6), noise_seed=3)
    block = high.block()
    observations = high.observations(block, without=("ins_attitudes",))
    result = adjust_block(block, observations)
    show("high: no correction", result.test.sigma0, heights(high, result.state))
    plain = GridRule(smoothing=Smoothing(), cross_validate=False)
    fields: tuple[CorrectionField | None, ...] = ()
    for words, cells, seams, rule in (
        ("high: plain means, once", 25, None, replace(plain, most_iterations=1)),
        ("high: plain means, 5 times", 25, None, plain),
        ("high: validated, not smoothed", 25, None, GridRule(8, Smoothing())),
        ("high: validated, smoothed", 25, None, GridRule(8)),
        ("high: the same with seams", 25, THIRDS, GridRule(8)),
        ("high: 9 × 9 with seams", 9, THIRDS, GridRule(8)),
    ):
        division = FormatCells.of(CAMERA.half_format, cells, seams)
        found = iterate_grid(block, result, (division,), block.camera_of_image, rule)
        validated = found if rule.cross_validate else None
        show(words, found.steps[-1].sigma0, heights(high, found.state), validated)
        fields = fields or (found.fields if seams else ())
    division = FormatCells.of(CAMERA.half_format, 15)
    found = collocate(block, result, (division,), block.camera_of_image)
    show("high: collocation, 15 × 15", found.steps[-1].sigma0, heights(high, found.state), found)
    low = flight(1200.0, (4, 10), (1, 5), noise_seed=4)
    low_block = low.block()
    low_observations = low.observations(low_block, without=("gnss_positions", "ins_attitudes"))
    before = adjust_block(low_block, low_observations)
    show("low: no correction", before.test.sigma0, heights(low, before.state))
    for words, method in (("validated, smoothed", iterate_grid), ("collocation, 15 × 15", collocate)):
        found = method(low_block, before, (division,), low_block.camera_of_image, GridRule(8))
        show(f"low: {words}", found.steps[-1].sigma0, heights(low, found.state), found)
    after = with_fields(low_block, low_observations, fields)
    show("low: grid of the high flight", after.test.sigma0, heights(low, after.state))
    division = FormatCells.of(CAMERA.half_format, 25, THIRDS)
    of_high, of_low = (
        residual_grid(
            division,
            item.image_points.xy,
            adjusted.groups[0].residual,
            controlled(adjusted.groups[0]),
        )
        for item, adjusted in ((observations, result), (low_observations, before))
    )
    same = compare_grids(of_high, of_low)
    print(
        f"mean residuals of both flights: correlation {same.correlation[0]:.2f} in x, "
        f"{same.correlation[1]:.2f} in y; {100 * same.differing:.0f} % of the sub-areas differ"
    )


if __name__ == "__main__":
    main()
