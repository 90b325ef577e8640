"""Seafloors of known shape, and submaps cut out of them with the errors of a reconstruction."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from frontend.arrays import FloatArray
from frontend.frames import planar_pose, transform
from frontend.heightfield import Heightfield
from frontend.submaps import Submap

PINGS_A_SUBMAP = 200


@dataclass(frozen=True)
class Seafloor:
    """Heights [m] and log-reflectivity on a 1 m grid whose first cell is the world's origin."""

    z: FloatArray
    log_reflectivity: FloatArray


def fractal(rng: np.random.Generator, size: int, exponent: float, longest: float) -> FloatArray:
    """A field of unit variance with a power-law spectrum, flat beyond a longest wavelength [m]."""
    k = np.maximum(np.hypot(*np.meshgrid(np.fft.fftfreq(size), np.fft.fftfreq(size))), 1 / longest)
    field = np.fft.ifft2(np.fft.fft2(rng.normal(size=(size, size))) * k ** (-exponent / 2)).real
    return field / field.std()


def boulders(rng: np.random.Generator, size: int, n: int) -> FloatArray:
    """Gaussian mounds and pits of 0.8 to 2.5 m radius and 0.2 to 0.8 m height."""
    z = np.zeros((size, size))
    for _ in range(n):
        row, column, radius = rng.uniform(0, size), rng.uniform(0, size), rng.uniform(0.8, 2.5)
        i = np.arange(max(int(row) - 10, 0), min(int(row) + 11, size))
        j = np.arange(max(int(column) - 10, 0), min(int(column) + 11, size))
        bump = np.exp(-((i[:, None] - row) ** 2 + (j[None] - column) ** 2) / (2 * radius**2))
        z[np.ix_(i, j)] += rng.uniform(0.2, 0.8) * rng.choice([-1.0, 1.0]) * bump
    return z


def rough_seafloor(rng: np.random.Generator, size: int = 300, rms: float = 0.8) -> Seafloor:
    """Fractal relief (spectrum k^-4.2 up to 120 m) with boulders and pits, and fractal sediment of 0.2."""
    z = rms * fractal(rng, size, 4.2, 120.0) + boulders(rng, size, size**2 // 600)
    return Seafloor(z, 0.2 * fractal(rng, size, 3.0, 60.0))


def rippled_seafloor(size: int = 300, wavelength: float = 10.0) -> Seafloor:
    """Straight sand waves 0.3 m high: every place looks like every other one wavelength on."""
    x = np.arange(size) * np.ones((size, 1))
    return Seafloor(0.3 * np.sin(2 * np.pi * x / wavelength), np.zeros((size, size)))


def cut_submap(
    seafloor: Seafloor,
    planar: tuple[float, float, float],
    rng: np.random.Generator,
    number: int = 0,
    error: float = 0.2,
) -> Submap:
    """The submap of a straight pass over a seafloor, 80 m long and 100 m wide.

    Its heights are in error by ``error`` [m] over lengths of 1.5 m and by half that over 10 m and more, both longer
    along the track, as the errors of one look direction are; offset (0.3 m) and tilt (0.01) are wrong too.
    """
    x, y = np.arange(-40.0, 41.0), np.arange(-50.0, 51.0)
    grid = np.stack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))], axis=-1)
    T_world_submap = planar_pose(*planar)
    world = transform(T_world_submap, grid)
    at = [world[..., 1], world[..., 0]]
    z, log_reflectivity = (
        map_coordinates(a, at, order=1, mode="constant", cval=np.nan) for a in (seafloor.z, seafloor.log_reflectivity)
    )
    short, long, leak = (_smoothed(rng, z.shape, sigma) for sigma in ((1.5, 2.0), (10.0, 15.0), (2.0, 3.0)))
    tilt = rng.normal(0, 0.01, 2)
    gauge = tilt[0] * grid[..., 0] + tilt[1] * grid[..., 1] + rng.normal(0, 0.3) - 12.0
    return Submap(
        number=number,
        first_ping=PINGS_A_SUBMAP * number,
        end_ping=PINGS_A_SUBMAP * (number + 1),
        anchor_ping=PINGS_A_SUBMAP * number + PINGS_A_SUBMAP // 2,
        anchor_time=1.5e9 + 100.0 * number,
        T_world_submap_dr=T_world_submap,
        T_submap_body=np.eye(4),
        surface=Heightfield(z + error * (short + 0.5 * long) + gauge, 1.0, (float(x[0]), float(y[0]))),
        sigma=np.full(z.shape, 1.1 * error),
        log_reflectivity=log_reflectivity + 0.2 * leak,
        is_shadow=np.zeros(z.shape, dtype=bool),
    )


def _smoothed(rng: np.random.Generator, shape: tuple[int, ...], sigma: tuple[float, float]) -> FloatArray:
    noise = gaussian_filter(rng.normal(size=shape), sigma)
    return noise / noise.std()
