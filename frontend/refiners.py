"""Refiners: alignment of two submaps' points by the registration of small_gicp, KISS-ICP or Open3D.

A relief is a sheet: points slide along it, and point-to-point methods stand still. So the source is cropped to what the
target covers and heights are exaggerated. All six parameters are found, and of them shift and yaw are kept.

Each runs on one thread: several sum in any order, and the same input would not give the same bytes.
"""

from collections.abc import Callable
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray
from frontend.frames import planar_parameters, planar_pose
from frontend.open3d_loader import load_open3d
from frontend.overlap import Layers, lay_over

Planar = tuple[float, float, float]  # x, y [m] and yaw [rad]
CloudRefinerName = Literal["small_gicp", "kiss_icp", "open3d_icp"]
_Align = Callable[[FloatArray, FloatArray, FloatArray, "CloudConfig"], FloatArray]

_LEAST_POINTS = 100  # of an overlap; fewer hold no shape, and none at all ends some of the libraries
_NEIGHBOURS = 13  # that make a normal: the cells within two of a cell
_NO_GAIN = 1e-9  # of fitness [1] and residual [m] that ends Open3D's steps


class CloudConfig(BaseModel):
    """How the points of two submaps are aligned."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    height: float = Field(
        default=1.5,
        gt=0,
        description="Root mean square [m] to which the relief is exaggerated: points slide along what is flat.",
    )
    reach: float = Field(
        default=2.0, gt=0, description="Largest distance of two points that may be one [m]; starts are a cell off."
    )
    n_iterations: int = Field(
        default=300, gt=0, description="Most iterations [1]; KISS-ICP creeps, the others need some ten."
    )
    kernel: float = Field(
        default=0.5, gt=0, description="Distance [m] beyond which KISS-ICP trusts a pair of points less; half a cell."
    )


def refine_by_clouds(
    layers: tuple[Layers, Layers], T_target_source: FloatArray, refiner: CloudRefinerName, config: CloudConfig
) -> Planar:
    """Align the reliefs of two submaps as clouds of points.

    Parameters
    ----------
    layers : tuple of Layers
        The target and the source.
    T_target_source : ndarray, shape (4, 4)
        Where to start, about a cell from the truth.
    refiner : str
        ``"small_gicp"`` (generalised ICP), ``"kiss_icp"`` (point to point with a robust kernel) or ``"open3d_icp"``
        (point to plane).
    config : CloudConfig
        Exaggeration and distances.

    Returns
    -------
    planar : tuple of float
        x, y [m] and yaw [rad] of ``T_target_source``: the turn about the vertical, and where the middle of the overlap
        goes; roll and pitch of the clouds are read as zero. The start, where the overlap holds too few points or the
        library finds nothing.
    """
    start = planar_parameters(T_target_source)
    overlap = lay_over(*layers, start)
    target = layers[0].cells[:, [0, 1, 3]]
    source = np.column_stack([overlap.x, overlap.y, overlap.z_source])
    if len(source) < _LEAST_POINTS:
        return start
    scale = np.array([1.0, 1.0, config.height / max(float(source[:, 2].std()), 1e-3)])
    T = _ALIGN[refiner](scale * target, scale * source, planar_pose(*start), config)
    return _level(T, source[:, :2].mean(axis=0)) if np.isfinite(T).all() else start


def _level(T: FloatArray, middle: FloatArray) -> Planar:
    """The level transform with the same turn about the vertical that takes a point to the same place."""
    x, y = T[:2, :2] @ middle + T[:2, 3]
    yaw = float(np.arctan2(T[1, 0] - T[0, 1], T[0, 0] + T[1, 1]))
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return float(x - cosine * middle[0] + sine * middle[1]), float(y - sine * middle[0] - cosine * middle[1]), yaw


def _by_small_gicp(target: FloatArray, source: FloatArray, T_start: FloatArray, config: CloudConfig) -> FloatArray:
    import small_gicp

    result = small_gicp.align(
        target,
        source,
        T_start,
        registration_type="GICP",
        downsampling_resolution=0.1,  # no two cells lie so near: all stay
        max_correspondence_distance=config.reach,
        num_threads=1,  # two do not sum in the same order
        max_iterations=config.n_iterations,
    )
    return np.asarray(result.T_target_source) if result.num_inliers else T_start


def _by_kiss_icp(target: FloatArray, source: FloatArray, T_start: FloatArray, config: CloudConfig) -> FloatArray:
    from kiss_icp.mapping import VoxelHashMap
    from kiss_icp.registration import Registration

    voxels = VoxelHashMap(voxel_size=config.reach / 2, max_distance=1e6, max_points_per_voxel=20)
    voxels.add_points(target)
    registration = Registration(max_num_iterations=config.n_iterations, convergence_criterion=1e-4, max_num_threads=1)
    # (sic): the library spells it so
    return np.asarray(
        registration.align_points_to_map(
            source, voxels, T_start, max_correspondance_distance=config.reach, kernel=config.kernel
        )
    )


def _by_open3d(target: FloatArray, source: FloatArray, T_start: FloatArray, config: CloudConfig) -> FloatArray:
    o3d = load_open3d()
    registration = o3d.pipelines.registration
    clouds = [o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)) for points in (target, source)]
    n_threads = o3d.utility.get_max_threads()
    o3d.utility.set_max_threads(1)
    try:
        clouds[0].estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=config.reach, max_nn=_NEIGHBOURS))
        method = registration.TransformationEstimationPointToPlane()
        stop = registration.ICPConvergenceCriteria(_NO_GAIN, _NO_GAIN, config.n_iterations)
        result = registration.registration_icp(clouds[1], clouds[0], config.reach, T_start, method, stop)
    finally:
        o3d.utility.set_max_threads(n_threads)
    return np.asarray(result.transformation)


_ALIGN: dict[CloudRefinerName, _Align] = {
    "small_gicp": _by_small_gicp,
    "kiss_icp": _by_kiss_icp,
    "open3d_icp": _by_open3d,
}
