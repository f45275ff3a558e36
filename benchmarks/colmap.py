"""The peer: COLMAP's bundle adjustment with pose priors, on the same block.

Two conventions differ. COLMAP's camera looks along +z with y down, ours along −z with y up, so the
camera frames are turned by diag(1, −1, −1). COLMAP does not weight image points; here its "pixel" is
the standard deviation of an image coordinate, so its residuals are already weighted and its cost is
half our vᵀPv, term by term.
"""

from __future__ import annotations

import numpy as np
import pycolmap

from adjust.arrays import Floats, Ints
from benchmarks.problem import Problem, Solution

# Camera frame of COLMAP (right, down, forward) from ours (right, up, backward).
_COLMAP_FROM_CAMERA = np.diag([1.0, -1.0, -1.0])
_CAMERA = 1


class Peer:
    """A block as COLMAP holds it.

    Attributes
    ----------
    problem : the block.
    reconstruction, priors : the same in COLMAP's terms; images and points are numbered from 1.
    threads : of the solver.
    free_camera : whether it estimates the camera, too.
    tolerance : change of the cost, as a part of it, at which it ends.
    """

    def __init__(
        self, problem: Problem, threads: int = 2, free_camera: bool = False, tolerance: float = 1e-8
    ) -> None:
        self.problem = problem
        self.threads = threads
        self.free_camera = free_camera
        self.tolerance = tolerance
        self.reconstruction = _reconstruction(problem)
        self.priors = _priors(problem)

    def reset(self) -> None:
        """Go back to the start values."""
        for index, pose in enumerate(_poses(self.problem.start)):
            self.reconstruction.frame(index + 1).rig_from_world = pose
        for index, xyz in enumerate(self.problem.object_point):
            self.reconstruction.point3D(index + 1).xyz = xyz

    def run(self) -> str:
        """Set up the problem and solve it, in place; what the solver says about it.

        The reconstruction is there already: the peer's clock does not pay for the Python loops
        that fill it.
        """
        return str(self._adjuster().solve().brief_report())

    def _adjuster(self) -> pycolmap.CeresBundleAdjuster:
        """The problem as the solver wants it."""
        config = pycolmap.BundleAdjustmentConfig()
        for image in range(1, len(self.problem.projection_centre) + 1):
            config.add_image(image)
        if not self.free_camera:
            config.set_constant_cam_intrinsics(_CAMERA)
        return pycolmap.create_pose_prior_ceres_bundle_adjuster(
            self._options(),
            pycolmap.PosePriorBundleAdjustmentOptions(),
            config,
            self.priors,
            self.reconstruction,
        )

    def _options(self) -> pycolmap.BundleAdjustmentOptions:
        """Least squares without a loss.

        Left to itself COLMAP takes an iterative solver for more than 1,000 images; the direct one is
        two to three times faster on these blocks, and the faster one is the one to compare with.
        """
        options = pycolmap.BundleAdjustmentOptions()
        options.refine_focal_length = self.free_camera
        options.refine_principal_point = self.free_camera
        options.refine_extra_params = self.free_camera
        options.print_summary = False
        options.ceres.auto_select_solver_type = False
        solver = options.ceres.solver_options
        solver.linear_solver_type = type(solver.linear_solver_type).SPARSE_SCHUR
        solver.num_threads = self.threads
        solver.function_tolerance = self.tolerance
        return options

    def solution(self) -> Solution:
        """The present values in our conventions."""
        images = range(1, len(self.problem.projection_centre) + 1)
        poses = np.stack([self.reconstruction.image(i).cam_from_world().matrix() for i in images])
        local_from_colmap = np.swapaxes(poses[:, :, :3], 1, 2)
        centre = -np.einsum("nij,nj->ni", local_from_colmap, poses[:, :, 3])
        points = range(1, len(self.problem.object_point) + 1)
        return Solution(
            centre,
            local_from_colmap @ _COLMAP_FROM_CAMERA,
            np.stack([self.reconstruction.point3D(j).xyz for j in points]),
        )


class PeerWithCovariances(Peer):
    """The same, with the joint covariances of all orientations after it."""

    def run(self) -> str:
        """As :meth:`Peer.run`; the peer's damping of singular problems is off."""
        adjuster = self._adjuster()
        report = str(adjuster.solve().brief_report())
        options = pycolmap.BACovarianceOptions()
        if not self.free_camera:
            options.params = pycolmap.BACovarianceOptionsParams.POSES
        options.damping = 0.0
        found = pycolmap.estimate_ba_covariance(options, self.reconstruction, adjuster)
        if found is None:
            raise RuntimeError("the peer has found no covariances")
        self.found = found
        return report

    def covariances(self, one: Ints, other: Ints) -> Floats:
        """Joint covariances (k, 6, 6) of the orientations of images, of the last run, in our unknowns.

        Ceres turns by exp(2 δ) on the left of the rotation that leads into the camera, and moves the
        translation t = −R X0; both are turned and moved here as ours: R ← R exp(θ), X0.
        """
        images = range(1, len(self.problem.projection_centre) + 1)
        ours = [_ours_by_theirs(self.reconstruction.image(i).cam_from_world().matrix()) for i in images]
        found = self.found
        blocks = [
            ours[i] @ np.array(found.get_cam_cov_from_world(i + 1)) @ ours[i].T
            if i == j
            else ours[i] @ np.array(found.get_cam_cross_cov_from_world(i + 1, j + 1)) @ ours[j].T
            for i, j in zip(one.tolist(), other.tolist(), strict=True)
        ]
        return np.stack(blocks)


def _ours_by_theirs(camera_from_world: Floats) -> Floats:
    """Derivatives (6, 6) of X0 and θ by δ and t: X0 = −Rᵀ t, and θ is −2 δ in our axes of the camera."""
    rotation, (x, y, z) = camera_from_world[:, :3], camera_from_world[:, 3]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    derivatives = np.zeros((6, 6))
    derivatives[:3, :3], derivatives[:3, 3:] = -2.0 * rotation.T @ cross, -rotation.T
    derivatives[3:, :3] = -2.0 * _COLMAP_FROM_CAMERA
    return derivatives


def _poses(values: Solution) -> list[pycolmap.Rigid3d]:
    """Camera from world of every image."""
    rotations = _COLMAP_FROM_CAMERA @ np.swapaxes(values.local_from_camera, 1, 2)
    translations: Floats = -np.einsum("nij,nj->ni", rotations, values.projection_centre)
    return [
        pycolmap.Rigid3d(pycolmap.Rotation3d(rotation), translation)
        for rotation, translation in zip(rotations, translations, strict=True)
    ]


def _reconstruction(problem: Problem) -> pycolmap.Reconstruction:
    """Camera, images with their points, and object points with their tracks."""
    unit = problem.sigma_image[0]
    c, x0, y0 = problem.interior / unit
    keypoints = problem.xy / unit * [1.0, -1.0]
    size = int(2 * np.abs(keypoints).max()) + 1
    reconstruction = pycolmap.Reconstruction()
    camera = pycolmap.Camera(
        model="SIMPLE_PINHOLE", width=size, height=size, params=[c, x0, -y0], camera_id=_CAMERA
    )
    reconstruction.add_camera_with_trivial_rig(camera)
    order = np.argsort(problem.image, kind="stable")
    start = np.searchsorted(problem.image[order], np.arange(len(problem.projection_centre) + 1))
    place = np.empty(len(order), dtype=np.int64)  # of each image point among those of its image
    for index, pose in enumerate(_poses(problem.start)):
        mine = order[start[index] : start[index + 1]]
        place[mine] = np.arange(len(mine))
        image = pycolmap.Image(str(index), keypoints[mine], _CAMERA, index + 1)
        reconstruction.add_image_with_trivial_frame(image, pose)
    starts = np.searchsorted(problem.point, np.arange(len(problem.object_point) + 1))
    images, places = (problem.image + 1).tolist(), place.tolist()
    for index, xyz in enumerate(problem.object_point):
        track = pycolmap.Track()
        for ray in range(starts[index], starts[index + 1]):
            track.add_element(images[ray], places[ray])
        reconstruction.add_point3D(xyz, track)
    return reconstruction


def _priors(problem: Problem) -> list[pycolmap.PosePrior]:
    """The observed positions with their covariance."""
    return [
        pycolmap.PosePrior(
            pose_prior_id=index + 1,
            corr_data_id=pycolmap.data_t(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, _CAMERA), index + 1),
            position=position,
            position_covariance=covariance,
            coordinate_system=pycolmap.PosePriorCoordinateSystem.CARTESIAN,
        )
        for index, (position, covariance) in enumerate(
            zip(problem.position, problem.position_covariance, strict=True)
        )
    ]
