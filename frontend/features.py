"""Features: keypoints of the relief and the FPFH descriptors of the shape around them."""

from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.ndimage import maximum_filter
from scipy.spatial.distance import cdist

from frontend.arrays import BoolArray, FloatArray
from frontend.fpfh import N_BINS, fast_point_feature_histograms
from frontend.heightfield import Heightfield
from frontend.relief import Relief, ReliefConfig, extract_relief
from frontend.submaps import Submap, surface_normals

_RADIUS_CELLS = 6.0


class FeatureConfig(BaseModel):
    """Where a submap is described and over what neighbourhood."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    radius: float = Field(
        default=8.0,
        gt=0,
        description="Radius of the shape that a descriptor sees [m], at least 6 cells; on less all floor looks alike.",
    )
    wide_radius: float = Field(
        default=0.0,
        ge=0,
        description="Radius [m] of a second, wider shape whose histograms stand beside those of the first; 0 is none, "
        "for two scales find no more places.",
    )
    lattice: float = Field(
        default=2.0,
        gt=0,
        description="Distance of the points that stand for the shape around a keypoint [m]; 1 finds no more.",
    )
    keypoint_spacing: float = Field(
        default=3.0,
        gt=0,
        description="Least distance of two keypoints [m]; about the shortest wavelength that repeats.",
    )
    exaggeration: float = Field(
        default=4.0,
        gt=0,
        description="Factor on the heights [1]: slopes of a few degrees then spread over FPFH's angle bins.",
    )
    least_distinct: float = Field(
        default=0.0,
        ge=0,
        lt=1,
        description="Keypoints are left out whose descriptor has another of the submap nearer than this share [1] of "
        "their median distance: ripples look alike; 0 keeps all, for verification knows ripples.",
    )
    max_relative_sigma: float = Field(
        default=2.0,
        gt=0,
        description="Points whose height sigma exceeds this many medians [1] of the submap are left out.",
    )
    min_points: int = Field(
        default=50,
        gt=0,
        description="Usable cells [1] below which a submap has no features: less than one neighbourhood.",
    )
    relief: ReliefConfig = ReliefConfig()

    @property
    def radii(self) -> tuple[float, ...]:
        """Radii of the shapes that a descriptor sees [m]."""
        return (self.radius, self.wide_radius) if self.wide_radius else (self.radius,)


@dataclass(frozen=True)
class Features:
    """Described keypoints of a submap.

    Parameters
    ----------
    keypoints : ndarray, shape (K, 3)
        Positions in the submap frame [m], z as reconstructed.
    descriptors : ndarray, shape (K, 33 R)
        FPFH histograms of R radii: three angles of 11 bins that sum to 200 each [1].
    normals : ndarray, shape (K, 3)
        Upward unit normals of the exaggerated relief.
    """

    keypoints: FloatArray
    descriptors: FloatArray
    normals: FloatArray

    def __len__(self) -> int:
        return len(self.keypoints)


def describe(submap: Submap, config: FeatureConfig | None = None) -> Features:
    """Find and describe the keypoints of a submap.

    Parameters
    ----------
    submap : Submap
        Heights with their sigmas and shadow flags.
    config : FeatureConfig, optional
        Spacing and radius.

    Returns
    -------
    features : Features
        Keypoints in the order of the raster's rows; none where too little is known. Shadowed and uncertain points take
        no part. Deterministic, whatever the number of threads.
    """
    config = config or FeatureConfig()
    return describe_relief(extract_relief(submap, config.relief), config)


def describe_relief(relief: Relief, config: FeatureConfig | None = None) -> Features:
    """Find and describe the keypoints of a relief already extracted.

    Parameters
    ----------
    relief : Relief
        Band-passed heights and weights.
    config : FeatureConfig, optional
        Spacing and radius.

    Returns
    -------
    features : Features
        As `describe` gives them.
    """
    config = config or FeatureConfig()
    usable = _usable(relief, config.max_relative_sigma)
    if usable.sum() < config.min_points:
        return Features(np.empty((0, 3)), np.empty((0, N_BINS * len(config.radii))), np.empty((0, 3)))
    surface = Heightfield(np.where(usable, config.exaggeration * relief.z, np.nan), relief.spacing, relief.origin)
    is_keypoint = find_keypoints(relief.z, usable, config.keypoint_spacing / relief.spacing)
    x, y = np.meshgrid(surface.x, surface.y)
    normals = surface_normals(surface)
    descriptors = _describe(surface, normals, is_keypoint, config)
    kept = _distinct(descriptors, config.least_distinct)
    keypoints = np.stack([x, y, relief.height], axis=-1)[is_keypoint]
    return Features(keypoints[kept], descriptors[kept], normals[is_keypoint][kept])


def find_keypoints(z: FloatArray, usable: BoolArray, spacing: float) -> BoolArray:
    """Crests and hollows of a relief, none closer than a distance to a stronger one of its kind.

    Parameters
    ----------
    z : ndarray, shape (n_y, n_x)
        Relief of zero mean [m].
    usable : ndarray of bool, shape (n_y, n_x)
        Cells that count.
    spacing : float
        Radius of the neighbourhood [cells].

    Returns
    -------
    is_keypoint : ndarray of bool, shape (n_y, n_x)
        Cells that are the highest or the lowest of their round neighbourhood, whatever the heading of the grid.
    """
    reach = max(int(spacing), 1)
    rows, columns = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    disc = np.hypot(rows, columns) <= max(spacing, 1.0)
    crest, hollow = (
        usable & (a == maximum_filter(a, footprint=disc, mode="constant", cval=-np.inf)) & (a > 0)
        for a in (np.where(usable, z, -np.inf), np.where(usable, -z, -np.inf))
    )
    return np.asarray(crest | hollow)


def _usable(relief: Relief, max_relative_sigma: float) -> BoolArray:
    """Trusted cells whose height is no much worse known than that of most."""
    if not relief.is_trusted.any():
        return relief.is_trusted
    limit = max_relative_sigma * float(np.median(relief.sigma[relief.is_trusted]))
    return np.asarray(relief.is_trusted & (relief.sigma <= limit))


def _distinct(descriptors: FloatArray, least: float) -> BoolArray:
    """Which descriptors are no nearer to any other than a share of the median distance between two."""
    if least == 0 or len(descriptors) < 2:
        return np.ones(len(descriptors), dtype=np.bool_)
    distances = cdist(descriptors, descriptors)
    np.fill_diagonal(distances, np.inf)
    return np.asarray(distances.min(axis=1) >= least * np.median(distances[np.isfinite(distances)]))


def _describe(surface: Heightfield, normals: FloatArray, is_keypoint: BoolArray, config: FeatureConfig) -> FloatArray:
    """FPFH of the keypoints among themselves and a thinned lattice of the other known cells, radius beside radius."""
    rows, columns = np.indices(surface.z.shape)
    step = max(round(config.lattice / surface.spacing), 1)
    z = np.where((rows % step == 0) & (columns % step == 0) | is_keypoint, surface.z, np.nan)
    reaches = [max(radius, _RADIUS_CELLS * surface.spacing) for radius in config.radii]
    shape = (z, normals, is_keypoint, surface.spacing)
    return np.concatenate([fast_point_feature_histograms(*shape, reach) for reach in reaches], axis=1)
