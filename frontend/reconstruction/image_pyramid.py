"""A ground-range image and its shadow map at falling resolution."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from frontend.arrays import BoolArray, FloatArray
from frontend.reconstruction.ground_image import GroundImage

_SMALLEST = 4  # pixels of the coarsest image along either axis


def pyramid(image: GroundImage, is_shadow: BoolArray, n_levels: int) -> list[tuple[GroundImage, BoolArray]]:
    """The image and its shadow map at falling resolution.

    Parameters
    ----------
    image : GroundImage
        The finest image.
    is_shadow : ndarray of bool, shape (2, n_y, n_x)
        Its shadow map.
    n_levels : int
        How many; fewer where the coarsest would have no pixels left.

    Returns
    -------
    levels : list of (GroundImage, ndarray of bool)
        The coarsest first. Rows and columns without echoes are added so that each level halves exactly.
    """
    smallest = min(image.level.shape[1:])
    n_levels = max(1, min(n_levels, int(np.log2(max(smallest / _SMALLEST, 1.0))) + 1))
    levels = [(_padded(image, 2 ** (n_levels - 1)), _pad(is_shadow, 2 ** (n_levels - 1), False))]
    for _ in range(n_levels - 1):
        levels.append((_halved(levels[-1][0]), _blocks(levels[-1][1] * 1.0).mean(axis=(2, 4)) > 0.5))
    return levels[::-1]


def _pad(values: NDArray[Any], multiple: int, fill: float | bool) -> NDArray[Any]:
    pads = [(0, 0)] * (values.ndim - 2) + [(0, -n % multiple) for n in values.shape[-2:]]
    return np.pad(values, pads, constant_values=fill)


def _padded(image: GroundImage, multiple: int) -> GroundImage:
    extra = (0, -len(image.sensor_height) % multiple)
    sensor, nadir = (np.pad(values, extra, mode="edge") for values in (image.sensor_height, image.nadir_height))
    level, looks = _pad(image.level, multiple, 1.0), _pad(image.looks, multiple, 0.0)
    return replace(image, level=level, looks=looks, sensor_height=sensor, nadir_height=nadir)


def _blocks(values: FloatArray) -> FloatArray:
    n_y, n_x = values.shape[-2:]
    return values.reshape(*values.shape[:-2], n_y // 2, 2, n_x // 2, 2)


def _halved(image: GroundImage) -> GroundImage:
    looks = _blocks(image.looks).sum(axis=(2, 4))
    total = _blocks(image.looks * image.level).sum(axis=(2, 4))
    level = np.divide(total, looks, out=np.ones_like(total), where=looks > 0)
    sensor, nadir = (np.asarray(part).reshape(-1, 2).mean(axis=1) for part in (image.sensor_height, image.nadir_height))
    spacing = (2 * image.spacing[0], 2 * image.spacing[1])
    return replace(image, level=level, looks=looks, sensor_height=sensor, nadir_height=nadir, spacing=spacing)
