"""Submaps of several passes as one map: by inverse variance, in the world, at true poses; and what is to be judged."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scenes import Dive
from scipy.ndimage import binary_closing, map_coordinates

from frontend.arrays import FloatArray, IntArray
from frontend.frames import invert, level, transform
from frontend.heightfield import Heightfield
from frontend.reconstruction.forward import Beams, Raster, coverage
from frontend.reconstruction.joint import cell_spacing
from frontend.reconstruction.window_data import WindowData, raster_of, window_data
from frontend.submaps import Submap
from frontend.trajectory import Trajectory
from frontend.windows import Window
from sssslam.evaluation.association import interpolate
from sssslam.evaluation.reconstruction import averaged

_IN_SHADOW = 1e-6  # weight of a cell that a pass does not see: it counts where no other pass sees it


class Target(NamedTuple):
    """The true heights on a grid in the world, and how many passes truly see each cell."""

    surface: Heightfield
    count: IntArray


class Fused(NamedTuple):
    """Heights in the world and their sigma."""

    surface: Heightfield
    sigma: FloatArray


def target(dive: Dive) -> Target:
    """What is to be reconstructed: the terrain, averaged over cells, where the passes see it."""
    truth = dive.recording.truth
    assert truth is not None
    assert truth.terrain is not None
    spacing = cell_spacing(float(dive.recording.slant_range_max.max()))
    fine = averaged(truth.terrain, spacing)
    seen = [_seen(dive, window, fine, spacing) for window in dive.windows]
    grid = _bounds([transform(T, _points(raster)[is_seen])[:, :2] for T, raster, is_seen in seen], spacing)
    count = sum(_on_grid(T, raster, is_seen, grid) for T, raster, is_seen in seen)
    z = fine.sample(*np.meshgrid(grid.x, grid.y))
    return Target(Heightfield(z, spacing, grid.origin), np.asarray(count, dtype=np.int64))


def fuse(submaps: Sequence[Submap], trajectory_ref: Trajectory, grid: Heightfield) -> Fused:
    """Weigh each submap by one over its variance, on a grid in the world."""
    top, base, variance = (np.zeros(grid.z.shape) for _ in range(3))
    for submap in submaps:
        pose = level(interpolate(trajectory_ref, [submap.anchor_time]).poses[0])
        z, sigma, shadow = _laid_out(pose, submap, grid)
        known = np.isfinite(z) & (sigma > 0)
        weight = np.where(known, np.where(shadow > 0.5, _IN_SHADOW, 1.0) / np.where(known, sigma, 1.0) ** 2, 0.0)
        top, base = top + weight * np.where(known, z, 0.0), base + weight
        variance += weight**2 * np.where(known, sigma, 0.0) ** 2
    safe = np.where(base > 0, base, np.nan)
    return Fused(Heightfield(top / safe, grid.spacing, grid.origin), np.sqrt(variance) / safe)


def _laid_out(
    T_world_submap: FloatArray, submap: Submap, grid: Heightfield
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Heights, sigmas and shadows of a submap on a grid in the world."""
    points = np.stack([*np.meshgrid(grid.x, grid.y), np.zeros(grid.z.shape)], axis=-1)
    x, y, _ = np.moveaxis(transform(invert(T_world_submap), points), -1, 0)
    rasters = (submap.surface.z, submap.sigma, submap.is_shadow.astype(np.float64))
    z, sigma, shadow = (Heightfield(r, submap.surface.spacing, submap.surface.origin).sample(x, y) for r in rasters)
    return z + T_world_submap[2, 3], sigma, shadow


def _seen(dive: Dive, window: Window, terrain: Heightfield, spacing: float) -> tuple[FloatArray, Raster, FloatArray]:
    """The frame of a window, its raster, and the cells that its pings truly see."""
    data = window_data(dive.recording, window, dive.bottom, dive.radiometry)
    raster = raster_of(data, spacing)
    points = transform(data.T_world_submap, _points(raster))
    z = terrain.sample(points[..., 0], points[..., 1]) - data.T_world_submap[2, 3]
    lowest = float(np.nanmin(z))
    _, seen = coverage(np.where(np.isfinite(z), z, lowest), raster, _beams(data), data.slant_range_max)
    closed = binary_closing(np.pad(seen, 1))[1:-1, 1:-1]  # lines fan out in turns
    return data.T_world_submap, raster, closed & np.isfinite(z)


def _beams(data: WindowData) -> Beams:
    rotation = data.T_submap_pings[:, :3, :3]
    side = np.stack([rotation[:, :, 1], -rotation[:, :, 1]], axis=1)
    return Beams(data.sensors, rotation[:, :, 0], side, rotation[:, :, 2], data.advance, data.turn)


def _points(raster: Raster) -> FloatArray:
    x = raster.origin[0] + raster.spacing * np.arange(raster.n_x)
    y = raster.origin[1] + raster.spacing * np.arange(raster.n_y)
    return np.stack([*np.meshgrid(x, y), np.zeros(raster.shape)], axis=-1)


def _bounds(places: Sequence[FloatArray], spacing: float) -> Heightfield:
    """An empty grid, in whole multiples of the spacing, that holds all places."""
    ends = np.concatenate(places)
    first, last = np.floor(ends.min(axis=0) / spacing), np.ceil(ends.max(axis=0) / spacing)
    n_x, n_y = (int(n) for n in last - first + 1)
    return Heightfield(np.zeros((n_y, n_x)), spacing, (float(first[0] * spacing), float(first[1] * spacing)))


def _on_grid(T_world_submap: FloatArray, raster: Raster, mask: FloatArray, grid: Heightfield) -> IntArray:
    """1 where the nearest cell of the raster is in the mask."""
    points = np.stack([*np.meshgrid(grid.x, grid.y), np.zeros(grid.z.shape)], axis=-1)
    x, y, _ = np.moveaxis(transform(invert(T_world_submap), points), -1, 0)
    place = np.stack([y - raster.origin[1], x - raster.origin[0]]) / raster.spacing
    return np.asarray(map_coordinates(mask.astype(np.int64), place, order=0, mode="constant", cval=0))
