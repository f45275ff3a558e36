"""A camera that took no image, as the virtual image of a platform of heads, hinders no format."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tasks.handover.formats.register import REGISTER
from tasks.handover.results import with_images_only
from tasks.handover.rig_heads import RigHeads
from tests.tasks.handover.flown_block import Flight, delivered, flown, points_of

# Grids of correction polynomials are coarse, those of a forward distortion take seconds.
REFRACTED = Flight(2000.0, refracted=True, corrections=True)


@pytest.fixture(scope="module")
def alone():
    """The block with the images of one camera, and that camera only."""
    results, _ = flown(REFRACTED)
    images = replace(
        results.images,
        camera=np.zeros(4, dtype=np.int64),
        **{name: getattr(results.images, name)[:1] for name in ("focal_length", "half_format", "pixel_size")},
    )
    return replace(results, images=images, cameras=results.cameras[:1])


@pytest.fixture(scope="module")
def beside(alone):
    """The same beside a camera before it and one behind it, the first of which is its reference head."""
    results, _ = flown(REFRACTED)
    images = replace(
        results.images,
        camera=np.ones(4, dtype=np.int64),
        **{
            name: np.repeat(getattr(alone.images, name), 3, axis=0)
            for name in ("focal_length", "half_format", "pixel_size")
        },
    )
    cameras = (results.cameras[1], results.cameras[0], results.cameras[1])
    heads = RigHeads(np.array([0, 0, 2]), np.arange(4))
    return replace(results, images=images, cameras=cameras, heads=heads)


@pytest.fixture(scope="module")
def found(beside):
    """What is left of it: the cameras with images."""
    return with_images_only(beside)


@pytest.fixture(scope="module")
def points(alone):
    return points_of(alone)


# A GeoPackage has the time of its writing.
@pytest.mark.parametrize("name", sorted(set(REGISTER) - {"geopackage"}))
def test_every_format_is_written_as_without_it(alone, found, points, name):
    made, expected = (REGISTER[name].write(delivered(one, points, name)) for one in (found, alone))
    assert made == expected


def test_heads_without_an_image_of_their_reference_head_are_no_written_rig(found):
    identity, nothing = np.tile(np.eye(3), (4, 1, 1)), np.zeros((4, 3))
    assert found.heads.against_reference(found.images.camera, identity, nothing) is None
