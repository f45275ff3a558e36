"""Self-calibration with everything on, against the bare adjustment of the same block.

Twelve parameters of Ebner are offered and selected, boresight and GNSS shift are free, one image point of
five hundred is wrong by 40 µm, and data snooping looks for it. Processor time on one thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from statistics import median

import numpy as np

from adjust.adjustment import estimate_block
from adjust.block import Block
from adjust.camera.additional.base import ImageFormat
from adjust.camera.additional.register import AdditionalParameters, additional_parameters
from adjust.camera.additional.self_calibration import SelfCalibration
from adjust.options import AdjustmentOptions
from adjust.parameters import SystemParameters, additional_family
from adjust.selection.elimination import PRESETS
from adjust.selection.parameter_selection import SelectedAdjustment, adjust_with_selection
from adjust.simulate.block import simulate_block
from adjust.solve.system import Observations
from benchmarks.machine import machine, peak_memory_mib
from benchmarks.record import SELECTION, Record
from benchmarks.workload import Workload
from tasks.settings.load_simulation import load_simulation
from tasks.simulation.simulation_input import block_specification

_WRONG, _SIZE_M = 0.002, 40e-6
_OPTIONS = AdjustmentOptions(threads=1)


def selection(workload: Workload, runs: int) -> Record:
    """Adjust a block bare, and with selection and data snooping, in turns after one of each untimed."""
    simulated = simulate_block(block_specification(load_simulation("dmc2-230", workload.overrides)))
    plain = simulated.block()
    known = simulated.observations(plain, without=("control_points", "ins_attitudes"))
    free = simulated.block(("boresight", "gnss_shift"))
    offered = _offered(free)
    block = _with_parameters(free, offered)
    observations = _with_errors(
        simulated.observations(free, without=("gnss_strip_bias",)), offered, len(free.images)
    )
    options = replace(_OPTIONS, critical_value=4.13)

    def bare() -> object:
        return estimate_block(plain, known, _OPTIONS)

    def everything() -> SelectedAdjustment:
        return adjust_with_selection(block, observations, options, PRESETS["default"])

    bare()
    found = everything()
    pairs = [(_processor_s(bare), _processor_s(everything)) for _ in range(runs)]
    seconds = [whole for _, whole in pairs]
    return Record(
        name=f"{SELECTION}{workload.name}",
        ours_s=median(seconds),
        ours_min_s=min(seconds),
        ours_max_s=max(seconds),
        peer_s=median(alone for alone, _ in pairs),
        ratio=median(whole / alone for alone, whole in pairs),
        runs=runs,
        included="processor seconds: 12 parameters selected, data snooping; peer: our bare adjustment",
        machine=machine(),
        images=len(block.images),
        image_points=len(observations.image_points.image),
        peak_memory_mib=peak_memory_mib(),
        report=f"{sum(found.result.rejected_per_pass)} rejected",
    )


def _processor_s(work: Callable[[], object]) -> float:
    begun = time.process_time()
    work()
    return time.process_time() - begun


def _offered(block: Block) -> AdditionalParameters:
    half_x, half_y = block.cameras[0].half_format
    return additional_parameters("ebner", ImageFormat(float(half_x), float(half_y)))


def _with_parameters(block: Block, offered: AdditionalParameters) -> Block:
    shape = (1, len(offered.names))
    family = additional_family(offered.names, offered.units)
    own = SystemParameters(family, (block.cameras[0].name,), np.zeros(shape), np.ones(shape, dtype=bool))
    return replace(block, system=(*block.system, own))


def _with_errors(observations: Observations, offered: AdditionalParameters, images: int) -> Observations:
    random, rays = np.random.default_rng(3), observations.image_points
    wrong = random.random(len(rays.image)) < _WRONG
    xy = rays.xy.copy()
    xy[wrong] += random.normal(0.0, _SIZE_M, (int(wrong.sum()), 2))
    of_image = np.zeros(images, dtype=np.int64)
    calibration = SelfCalibration(offered.names, (offered,), of_image)
    return replace(observations, image_points=replace(rays, xy=xy, self_calibration=calibration))
