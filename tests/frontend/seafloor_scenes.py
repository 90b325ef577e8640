"""Seafloors of known shape, and submaps cut out of them with the errors of a reconstruction."""

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from frontend.arrays import FloatArray
from frontend.frames import planar_pose, transform
from frontend.heightfield import Heightfield
from frontend.submaps import Submap

SWATH = (80.0, 100.0)  # along and across the track [m]


def fractal_seafloor(rng: np.random.Generator, size: int = 400, rms: float = 0.8, n_boulders: int = 300) -> FloatArray:
    """Heights [m] on a 1 m grid: a power-law spectrum k^-4.2 with boulders and pits."""
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size)))
    k[0, 0] = np.inf
    z = np.fft.ifft2(np.fft.fft2(rng.normal(size=(size, size))) * k**-2.1).real
    return z * (rms / z.std()) + boulders(rng, size, n_boulders)


def boulders(rng: np.random.Generator, size: int, n: int) -> FloatArray:
    """Gaussian mounds and pits of 0.8 to 2.5 m radius and up to 0.8 m height."""
    z = np.zeros((size, size))
    for _ in range(n):
        row, column, radius = rng.uniform(0, size), rng.uniform(0, size), rng.uniform(0.8, 2.5)
        i = np.arange(max(int(row) - 10, 0), min(int(row) + 11, size))
        j = np.arange(max(int(column) - 10, 0), min(int(column) + 11, size))
        bump = np.exp(-((i[:, None] - row) ** 2 + (j[None] - column) ** 2) / (2 * radius**2))
        z[np.ix_(i, j)] += rng.uniform(0.2, 0.8) * rng.choice([-1.0, 1.0]) * bump
    return z


def cut_submap(
    terrain: FloatArray,
    planar: tuple[float, float, float],
    rng: np.random.Generator,
    number: int = 0,
    error: float = 0.2,
) -> Submap:
    """The submap of a straight pass over a terrain, its heights in error by ``error`` [m] over 1.5 m and more.

    The error is stronger along the track than across it, as a side-scan's is; offset and tilt are wrong too.
    """
    x, y = np.arange(-SWATH[0] / 2, SWATH[0] / 2 + 0.5), np.arange(-SWATH[1] / 2, SWATH[1] / 2 + 0.5)
    grid = np.stack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))], axis=-1)
    T_world_submap = planar_pose(*planar)
    world = transform(T_world_submap, grid)
    z = map_coordinates(terrain, [world[..., 1], world[..., 0]], order=1, mode="constant", cval=np.nan)
    noise = gaussian_filter(rng.normal(size=z.shape), (1.5, 2.0))
    long_wave = gaussian_filter(rng.normal(size=z.shape), (10.0, 15.0))
    tilt = rng.normal(0, 0.01, 2)
    wrong = z + error * (noise / noise.std() + 0.5 * long_wave / long_wave.std())
    height = wrong + tilt[0] * grid[..., 0] + tilt[1] * grid[..., 1] + rng.normal(0, 0.3) - 12.0
    noise = gaussian_filter(rng.normal(size=z.shape), 3.0)
    return Submap(
        number=number,
        first_ping=200 * number,
        end_ping=200 * number + 200,
        anchor_ping=200 * number + 100,
        anchor_time=1.5e9 + 100.0 * number,
        T_world_submap_dr=T_world_submap,
        T_submap_body=np.eye(4),
        surface=Heightfield(height, 1.0, (float(x[0]), float(y[0]))),
        sigma=np.full(z.shape, 1.1 * error),
        log_reflectivity=np.where(np.isfinite(z), 0.2 * noise / noise.std(), np.nan),
        is_shadow=np.zeros(z.shape, dtype=bool),
    )
