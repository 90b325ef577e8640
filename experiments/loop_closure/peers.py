"""What others would do: open3d's RANSAC and fast global registration, KISS-Matcher, MapClosures; none is required.

All are given the same band-passed relief as this project's chain, heights exaggerated as its features have them, and of
what they find shift and yaw are kept. The score is their number of inliers.
"""

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from frontend.arrays import FloatArray
from frontend.features import FeatureConfig
from frontend.frames import planar_pose, transform
from frontend.heightfield import Heightfield
from frontend.open3d_loader import load_open3d
from frontend.relief import Relief

Answer = tuple[FloatArray, int]
NOTHING: Answer = (np.full((4, 4), np.nan), 0)
NEEDS = {"kiss-matcher": "kiss_matcher", "map-closures": "map_closures"}  # package of a row

_NORMAL_RADIUS, _RADIUS, _TOLERANCE = 3.0, 8.0, 1.5  # [m]; the radius of this project's descriptors
_LEAST_POINTS = 200  # an empty cloud ends KISS-Matcher's interpreter
_PIXEL, _LEVELS = 0.5, 20  # [m] of MapClosures' image; grey levels of a height
_APART = 100  # numbers of two maps; near ones are never compared


@dataclass(frozen=True, eq=False)
class Cloud:
    """A relief as points, with open3d's cloud and descriptors."""

    points: FloatArray
    geometry: Any
    features: Any
    relief: Relief


def is_installed(row: str) -> bool:
    """Whether the package of a row is there."""
    return row not in NEEDS or find_spec(NEEDS[row]) is not None


def cloud_of(relief: Relief) -> Cloud:
    """The trusted cells as points with FPFH."""
    o3d = load_open3d()
    rows, columns = np.nonzero(relief.is_trusted)
    plane = np.array(relief.origin) + relief.spacing * np.column_stack([columns, rows])
    points = np.column_stack([plane, FeatureConfig().exaggeration * relief.z[rows, columns]])
    geometry = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    if not len(points):
        return Cloud(points, geometry, None, relief)
    geometry.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=_NORMAL_RADIUS, max_nn=60))
    geometry.orient_normals_to_align_with_direction(np.array([0.0, 0.0, 1.0]))
    search = o3d.geometry.KDTreeSearchParamHybrid(radius=_RADIUS, max_nn=400)
    return Cloud(points, geometry, o3d.pipelines.registration.compute_fpfh_feature(geometry, search), relief)


def ransac(target: Cloud, source: Cloud) -> Answer:
    """RANSAC over mutual FPFH matches."""
    o3d = load_open3d()
    if min(len(target.points), len(source.points)) < _LEAST_POINTS:
        return NOTHING
    o3d.utility.random.seed(0)
    registration, matches = o3d.pipelines.registration, _matches(target, source)
    checks = [
        registration.CorrespondenceCheckerBasedOnEdgeLength(0.9),
        registration.CorrespondenceCheckerBasedOnDistance(_TOLERANCE),
    ]
    result = registration.registration_ransac_based_on_correspondence(
        source.geometry,
        target.geometry,
        matches,
        _TOLERANCE,
        registration.TransformationEstimationPointToPoint(False),
        3,
        checks,
        registration.RANSACConvergenceCriteria(100_000, 0.999),
    )
    return _answer(np.asarray(result.transformation), target, source, np.asarray(matches))


def fast_global(target: Cloud, source: Cloud) -> Answer:
    """Fast global registration over mutual FPFH matches."""
    o3d = load_open3d()
    if min(len(target.points), len(source.points)) < _LEAST_POINTS:
        return NOTHING
    o3d.utility.random.seed(0)
    registration, matches = o3d.pipelines.registration, _matches(target, source)
    option = registration.FastGlobalRegistrationOption(
        use_absolute_scale=True, maximum_correspondence_distance=_TOLERANCE
    )
    result = registration.registration_fgr_based_on_correspondence(source.geometry, target.geometry, matches, option)
    return _answer(np.asarray(result.transformation), target, source, np.asarray(matches))


def kiss_matcher(target: Cloud, source: Cloud) -> Answer:
    """KISS-Matcher with radii that fit terrain."""
    import kiss_matcher as km

    if min(len(target.points), len(source.points)) < _LEAST_POINTS:
        return NOTHING
    config = km.KISSMatcherConfig(voxel_size=1.0, normal_r_gain=_NORMAL_RADIUS, fpfh_r_gain=_RADIUS, use_quatro=True)
    matcher = km.KISSMatcher(config)
    found = matcher.estimate(source.points.astype(np.float32), target.points.astype(np.float32))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = found.rotation, np.ravel(found.translation)
    return _levelled(T), int(matcher.get_num_final_inliers())


def map_closures(target: Cloud, source: Cloud) -> Answer:
    """MapClosures on images whose density of points is the height."""
    from map_closures.config import MapClosuresConfig
    from map_closures.map_closures import MapClosures

    if min(len(target.points), len(source.points)) < _LEAST_POINTS:
        return NOTHING
    maps = MapClosures(MapClosuresConfig(density_map_resolution=_PIXEL))
    maps.get_best_closure(0, _as_density(target.relief))
    closure = maps.get_best_closure(_APART, _as_density(source.relief))
    T = np.asarray(closure.pose)
    return _levelled(T), int(closure.number_of_inliers)


def _as_density(relief: Relief) -> FloatArray:
    """Points of which the more lie in a pixel the higher it is."""
    field = Heightfield(np.where(relief.is_trusted, relief.z, np.nan), relief.spacing, relief.origin)
    n_y, n_x = (int(n * relief.spacing / _PIXEL) for n in relief.z.shape)
    first = np.floor(np.array(relief.origin) / _PIXEL) * _PIXEL + _PIXEL / 2
    x, y = np.meshgrid(first[0] + _PIXEL * np.arange(n_x), first[1] + _PIXEL * np.arange(n_y))
    z = field.sample(x, y)
    known = np.isfinite(z)
    rank = np.clip(0.5 + z[known] / (2 * np.std(z[known]) + 1e-9), 0, 1)
    count = np.rint(rank * _LEVELS).astype(int)
    return np.repeat(np.column_stack([x[known], y[known], np.zeros(count.size)]), count, axis=0)


def _matches(target: Cloud, source: Cloud) -> Any:
    """Mutual nearest descriptors, source before target."""
    o3d = load_open3d()
    return o3d.pipelines.registration.correspondences_from_features(source.features, target.features, True)


def _answer(T: FloatArray, target: Cloud, source: Cloud, matches: FloatArray) -> Answer:
    """The level part of a transform and the matches that agree with the whole of it."""
    if len(matches) == 0:
        return NOTHING
    error = transform(T, source.points[matches[:, 0]]) - target.points[matches[:, 1]]
    return _levelled(T), int((np.linalg.norm(error, axis=1) <= _TOLERANCE).sum())


def _levelled(T: FloatArray) -> FloatArray:
    """Yaw and shift of a transform."""
    return planar_pose(float(T[0, 3]), float(T[1, 3]), float(np.arctan2(T[1, 0], T[0, 0])), float(T[2, 3]))
