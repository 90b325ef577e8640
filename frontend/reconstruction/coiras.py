"""The method of Coiras, Petillot and Lane: shape from stacked, ground-range-corrected lines of a straight track."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from scipy.ndimage import map_coordinates

from frontend.arrays import BoolArray, FloatArray
from frontend.bottom import Bottom
from frontend.heightfield import Heightfield
from frontend.radiometry import Radiometry
from frontend.reconstruction.forward import Raster
from frontend.reconstruction.ground_image import (
    Course,
    GroundImage,
    ImageConfig,
    ground_image,
    shadow_image,
    shadows_of_lines,
    straight_course,
)
from frontend.reconstruction.image_cost import DescentConfig, Estimate, ImageCost
from frontend.reconstruction.image_descent import descend, stop_watch, upsampled
from frontend.reconstruction.image_pyramid import pyramid
from frontend.reconstruction.joint import cell_spacing
from frontend.reconstruction.window_data import WindowData, raster_of, window_data
from frontend.recording import Recording
from frontend.shadows import ShadowConfig
from frontend.submaps import Submap
from frontend.windows import Window


class CoirasConfig(BaseModel):
    """The method of Coiras et al. 2007."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    spacing: float | None = Field(
        default=None, gt=0, description="Pixels of the finest image and cells of the submap [m]; unset: as the joint's."
    )
    sigma_factor: float = Field(
        default=1.0, gt=0, description="Sigma against what errors of slope add up to [1]; calibrated on simulation."
    )
    image: ImageConfig = ImageConfig()
    shadows: ShadowConfig = ShadowConfig()
    descent: DescentConfig = DescentConfig()


class Relief(NamedTuple):
    """What became of an image: the image, its shadow map, the estimate, and the cost after each iteration."""

    image: GroundImage
    is_shadow: BoolArray
    estimate: Estimate
    costs: list[list[float]]


def reconstruct(
    recording: Recording, window: Window, bottom: Bottom, radiometry: Radiometry, config: CoirasConfig
) -> Submap:
    """Reconstruct the seafloor of one window, the track taken for straight and the vehicle for level.

    Parameters
    ----------
    recording : Recording
        The dive.
    window : Window
        Which pings.
    bottom : Bottom
        First bottom returns and altitude of the dive.
    radiometry : Radiometry
        Says what a flat floor would look like; held but for a small correction of the beam pattern.
    config : CoirasConfig
        The method's settings.

    Returns
    -------
    submap : Submap
        Heights, sigma, log-reflectivity and shadow on a grid in the level frame of the anchor ping.

    Notes
    -----
    After [1]_: image formation ``I = R Phi cos(theta)^n``, inverted from coarse images to fine ones by descent on
    heights, reflectivity and beam pattern in turn. Rows lie at equal distances along the mean course, whatever the
    vehicle did: turns, pitch and roll distort the result.

    References
    ----------
    .. [1] Coiras, Petillot, Lane, "Multiresolution 3-D Reconstruction From Side-Scan Sonar Images", IEEE TIP
       16(2):382-390, 2007. :doi:`10.1109/TIP.2006.888337`
    """
    data = window_data(recording, window, bottom, radiometry)
    spacing = config.spacing or cell_spacing(data.slant_range_max)
    image = ground_image(data, radiometry, spacing, config.image)
    is_shadow = shadow_image(shadows_of_lines(data, radiometry, config.shadows), data, spacing)
    relief = shape_from_image(image, is_shadow, config)
    return submap_of_images(recording, window, data, relief, config)


def shape_from_image(image: GroundImage, is_shadow: BoolArray, config: CoirasConfig) -> Relief:
    """Explain an image by heights, reflectivity and beam pattern, from coarse to fine.

    Parameters
    ----------
    image : GroundImage
        Both sides.
    is_shadow : ndarray of bool, shape (2, n_y, n_x)
        The shadow map: where reflectivity is that of the surroundings.
    config : CoirasConfig
        The method's settings.

    Returns
    -------
    relief : Relief
        At the finest resolution that the deadline let it reach, brought to that of the image.

    Raises
    ------
    ValueError
        If the shadow map has not the shape of the image.
    """
    if is_shadow.shape != image.level.shape:
        raise ValueError(f"a shadow map like the image, {image.level.shape}, wanted, got {is_shadow.shape}")
    is_over = stop_watch(config.descent.deadline)
    estimate, costs = None, []
    for level, shadow in pyramid(image, is_shadow, config.image.n_levels):
        cost = ImageCost(level, shadow, config.descent)
        start = cost.start if estimate is None else upsampled(estimate, cost)
        estimate, values = descend(replace(cost, filled=start.reflectivity), start, is_over)
        costs.append(values)
    assert estimate is not None
    n_y, n_x = image.level.shape[1:]
    cropped = Estimate(estimate.height[:, :n_y, :n_x], estimate.reflectivity[:, :n_y, :n_x], estimate.beam)
    return Relief(image, is_shadow, cropped, costs)


def height_sigma(relief: Relief, config: CoirasConfig) -> FloatArray:
    """Standard deviation of the heights.

    Parameters
    ----------
    relief : Relief
        What became of an image.
    config : CoirasConfig
        The prior.

    Returns
    -------
    sigma : ndarray, shape (2, n_y, n_x)
        Standard deviations [m].

    Notes
    -----
    A pixel's brightness tells its slope with an error ``s / (n x / depth)``, where s is the speckle's relative standard
    deviation, made larger where the image is explained worse than speckle allows, and the reflectivity's, which is the
    same over its correlation length. From nadir outwards these add up like a random walk, until the relief that the
    prior expects bounds them. What waves longer than the prior's do is not in it.
    """
    image, prior = relief.image, config.descent
    cost = ImageCost(image, relief.is_shadow, config.descent)
    misfit = cost.weight * (image.level - cost.predict(relief.estimate)) ** 2
    excess = max(float(misfit.sum() / max(np.count_nonzero(cost.weight), 1)), 1.0)
    depth = (image.sensor_height - image.nadir_height)[:, None]
    by_slope = (image.exponent * image.ground_range / depth) ** 2
    slope = excess / (np.maximum(cost.weight, 1e-9) * by_slope)
    stray = (
        prior.reflectivity**2 / by_slope * min(2 * prior.reflectivity_length / image.spacing[1], image.level.shape[2])
    )
    roughness = prior.roughness * prior.longest / (2 * np.pi)  # variance of slopes that no data bound, per metre
    variance = np.minimum(slope + stray, roughness / image.spacing[1]) * image.spacing[1] ** 2
    walk = config.descent.altimeter_sigma**2 + np.cumsum(variance, axis=2)
    relief_most = prior.roughness * (prior.longest / (2 * np.pi)) ** 2 / (4 * np.pi)  # of C / (k^2 + k0^2)^2
    return config.sigma_factor * np.sqrt(1 / (1 / walk + 1 / (config.descent.altimeter_sigma**2 + relief_most)))


def submap_of_images(
    recording: Recording, window: Window, data: WindowData, relief: Relief, config: CoirasConfig
) -> Submap:
    """Lay both sides' images on a grid along the mean course.

    Parameters
    ----------
    recording : Recording
        The dive.
    window : Window
        Which pings.
    data : WindowData
        The window.
    relief : Relief
        What became of the images.
    config : CoirasConfig
        The prior, for sigma.

    Returns
    -------
    submap : Submap
        In the level frame of the anchor ping.
    """
    raster = raster_of(data, relief.image.spacing[1])
    at = _Places(raster, straight_course(data), relief.image)
    estimate = relief.estimate
    return Submap(
        window.number,
        window.first_ping,
        window.end_ping,
        window.anchor_ping,
        float(recording.ping_time[window.anchor_ping]),
        data.T_world_submap,
        data.T_submap_body,
        Heightfield(at.sample(estimate.height), raster.spacing, raster.origin),
        at.sample(height_sigma(relief, config)),
        relief.image.power * at.sample(estimate.reflectivity),
        at.sample(relief.is_shadow.astype(np.float64)) > 0.5,
    )


class _Places:
    """Where the cells of a raster lie in the images."""

    def __init__(self, raster: Raster, course: Course, image: GroundImage) -> None:
        x = raster.origin[0] + raster.spacing * np.arange(raster.n_x) - course.start[0]
        y = raster.origin[1] + raster.spacing * np.arange(raster.n_y)[:, None] - course.start[1]
        (c, s), (dy, dx) = course.direction, image.spacing
        step = float(np.hypot(*course.step))
        along, left = c * x + s * y, c * y - s * x
        self.row = (along + 0.5 * step) / dy - 0.5  # a row's pings begin half a step before the first
        self.column = np.abs(left) / dx - 0.5
        self.is_port = left > 0
        n_y, n_x = image.level.shape[1:]
        self.is_inside = (np.abs(self.row - 0.5 * (n_y - 1)) <= 0.5 * n_y) & (self.column <= n_x - 0.5)

    def sample(self, images: FloatArray) -> FloatArray:
        """Bilinear between pixels of a side; NaN beyond the images."""
        places = np.stack([self.row, self.column])
        port, starboard = (map_coordinates(side, places, order=1, mode="nearest") for side in images)
        return np.where(self.is_inside, np.where(self.is_port, port, starboard), np.nan)
