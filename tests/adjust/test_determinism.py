"""The same bytes whatever the number of threads, and in every run."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import threadpoolctl

REPOSITORY = Path(__file__).resolve().parents[2]

# Large enough for the linear algebra library to use several threads where it may.
PROGRAM = """
import hashlib
import numpy as np
from adjust.adjustment import adjust_block
from adjust.options import AdjustmentOptions
from tests.adjust.scenes import ALL_FREE, two_strips
scene = two_strips(
    strips=6, images_per_strip=12, points_along=40, points_across=24, cameras=2, flights=2,
    free=ALL_FREE, noise_seed=1, start_seed=2, gnss_correlation_s=20.0,
)
result = adjust_block(scene.block, scene.observations, AdjustmentOptions(critical_value=4.13))
digest = hashlib.sha256()
for array in (
    result.state.projection_centre, result.state.local_from_camera, result.state.object_point,
    *result.state.system.values(), result.cofactor.reduced.blocks, result.cofactor.reduced.border,
    result.cofactor.reduced.corner, result.cofactor.of_points,
    *(array for group in result.groups for array in (group.residual, group.redundancy, group.standardized)),
):
    digest.update(np.ascontiguousarray(array).tobytes())
print(len(scene.block.images), digest.hexdigest())

matrix = np.random.default_rng(1).normal(size=(700, 700))
print(hashlib.sha256((matrix @ matrix.T).tobytes()).hexdigest())
"""


def parsed(printed: str) -> tuple[str, str]:
    """Digest of an adjustment, and of a large matrix product outside of it."""
    adjustment, product = printed.splitlines()
    images, digest = adjustment.split()
    assert int(images) == 72
    return digest, product


def digests_of_this_process() -> tuple[str, str]:
    """With one thread."""
    with io.StringIO() as printed, contextlib.redirect_stdout(printed), threadpoolctl.threadpool_limits(1):
        exec(PROGRAM, {})
        return parsed(printed.getvalue())


def digests(threads: int) -> tuple[str, str]:
    """Of a process with so many threads."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": str(threads), "OMP_NUM_THREADS": str(threads)}
    environment |= {"NUMBA_NUM_THREADS": str(min(threads, os.cpu_count() or 1))}
    environment["PYTHONPATH"] = str(REPOSITORY)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        cwd=REPOSITORY,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
        timeout=200,
    )
    return parsed(done.stdout)


def test_results_are_the_same_bytes_for_any_number_of_threads_and_in_every_run() -> None:
    # Two processes: what differs from run to run would differ here as well.
    one, several = digests_of_this_process(), digests(4)
    assert one[0] == several[0]


def test_digests_of_arrays_see_the_last_bit() -> None:
    value = np.array([1.0])
    assert value.tobytes() != np.nextafter(value, 2.0).tobytes()
