"""Linearised shape from shading on the ground-range image: one linear system, no reflectivity, no pyramid."""

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

from frontend.arrays import FloatArray
from frontend.bottom import Bottom
from frontend.radiometry import Radiometry
from frontend.reconstruction.coiras import CoirasConfig, Relief, submap_of_images
from frontend.reconstruction.ground_image import ground_image, shadow_image, shadows_of_lines
from frontend.reconstruction.image_cost import Estimate, ImageCost
from frontend.reconstruction.joint import cell_spacing
from frontend.reconstruction.unknowns import from_cosine, to_cosine
from frontend.reconstruction.window_data import window_data
from frontend.recording import Recording
from frontend.submaps import Submap
from frontend.windows import Window

_CONFIG = CoirasConfig()


def reconstruct(recording: Recording, window: Window, bottom: Bottom, radiometry: Radiometry) -> Submap:
    """Brightness over a flat floor's, less one, is the slope across the track times ``n x / depth``."""
    data = window_data(recording, window, bottom, radiometry)
    spacing = cell_spacing(data.slant_range_max)
    image = ground_image(data, radiometry, spacing, _CONFIG.image)
    is_shadow = shadow_image(shadows_of_lines(data, radiometry, _CONFIG.shadows), data, spacing)
    cost = ImageCost(image, is_shadow, _CONFIG.descent)
    height = cost.start.height + _relief(cost)
    estimate = Estimate(height, np.zeros_like(height), cost.start.beam)
    return submap_of_images(recording, window, data, Relief(image, is_shadow, estimate, []), _CONFIG)


def _relief(cost: ImageCost) -> FloatArray:
    """Heights over the start: least squares between the brightness and the belief in smooth relief."""
    image, shape = cost.image, cost.image.level.shape
    depth = (image.sensor_height - image.nadir_height)[:, None]
    gain = image.exponent * image.ground_range / depth
    weight = np.where(cost.is_shadow, 0.0, cost.weight)

    def normal(flat: FloatArray) -> FloatArray:
        u = flat.reshape(shape)
        pushed = _adjoint(weight * gain**2 * _slope(u, image.spacing[1]), image.spacing[1])
        return (pushed + from_cosine(cost.precision[0] * to_cosine(u))).ravel()

    right = _adjoint(weight * gain * (image.level - 1), image.spacing[1]).ravel()
    mean = np.mean(weight * gain**2)
    k2 = (2 - 2 * np.cos(np.pi * np.arange(shape[2]) / shape[2])) / image.spacing[1] ** 2
    inverse = LinearOperator((right.size,) * 2, lambda r: _divided(r.reshape(shape), cost.precision[0] + mean * k2))
    solution, _ = cg(LinearOperator((right.size,) * 2, normal), right, M=inverse, rtol=1e-4, maxiter=200)
    return np.asarray(solution.reshape(shape))


def _divided(values: FloatArray, spectrum: FloatArray) -> FloatArray:
    return from_cosine(to_cosine(values) / spectrum).ravel()


def _slope(u: FloatArray, spacing: float) -> FloatArray:
    """Backward differences across the track, zero at nadir."""
    return np.diff(u, axis=2, prepend=0.0) / spacing


def _adjoint(slope: FloatArray, spacing: float) -> FloatArray:
    return (slope - np.concatenate([slope[:, :, 1:], 0 * slope[:, :, :1]], axis=2)) / spacing
