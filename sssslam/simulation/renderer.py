"""Mean echo intensity: rays outward in the true beam plane against the heightfield.

In the beam plane of an array, y is horizontal and points outward, w points down, and f is the array's axis. Going
outward a point is lit when its angle exceeds the largest so far; the solid angle it adds carries its energy to the
range bin of its echo. All facets in a bin add up: layover, shadow and first bottom return need no rules of their own.
"""

from typing import NamedTuple

import numpy as np
from numba import njit, prange

from frontend.arrays import AnyArray, Float32Array, FloatArray
from sssslam.simulation.beams import VERTICAL_STEP, horizontal_pattern, sub_beams, vertical_pattern
from sssslam.simulation.receiver import ReceiverConfig
from sssslam.simulation.seabed import Seabed, backscatter_table
from sssslam.simulation.sonar import SonarConfig
from sssslam.simulation.terrain import Terrain

_HORIZONTAL_STEP = 1.0 / 64.0
_INLINED = {
    "cache": True,
    "error_model": "numpy",
    "forceinline": True,  # a call that hands over the tables costs as much as the arithmetic
    "fastmath": {"contract", "reassoc", "arcp"},  # not nnan: NaN means beyond the terrain's edge
}


class Ground(NamedTuple):
    """Heights and reflectivity (n_y, n_x), spacing and origin [m]."""

    z: Float32Array
    reflectivity: Float32Array
    spacing: float
    x: float
    y: float


class Beam(NamedTuple):
    """Tables and numbers of one array; lengths in metres, angles in radians, absorption in nepers a metre of range."""

    vertical: FloatArray
    horizontal: FloatArray
    seabed: FloatArray
    offsets: FloatArray
    level: float
    array_length: float
    beamwidth: float
    absorption: float
    sound_speed: float
    surface: float
    step: float
    inner_angle: float
    sample_spacing: float


def render(terrain: Terrain, beam: Beam, planes: AnyArray, n_samples: int) -> FloatArray:
    """Mean echo intensity of pings of one array.

    Parameters
    ----------
    terrain : Terrain
        The seafloor; there is no echo from beyond its edge.
    beam : Beam
        The array, from `make_beam`.
    planes : structured ndarray, shape (N,)
        Where the array is and how it moves, from `planes.beam_planes`.
    n_samples : int
        Number of samples M.

    Returns
    -------
    intensity : ndarray, shape (N, M)
        Mean intensity without noise; level as `SonarConfig` says.
    """
    ground = Ground(terrain.z, terrain.reflectivity, terrain.spacing, *terrain.origin)
    intensity = np.zeros((planes.size, n_samples))
    _render(ground, beam, planes, intensity)
    return intensity


def make_beam(sonar: SonarConfig, receiver: ReceiverConfig, seabed: Seabed, sound_speed: float, loss: float) -> Beam:
    """Tabulate what the rays of a sonar need.

    Parameters
    ----------
    sonar : SonarConfig
        The sonar.
    receiver : ReceiverConfig
        Gain, and loss at the surface.
    seabed : Seabed
        The scattering law.
    sound_speed : float
        Sound speed [m/s].
    loss : float
        Absorption, one way [dB/m].

    Returns
    -------
    beam : Beam
        The tables.
    """
    offsets = sub_beams(sonar)
    width = 2 * sonar.sub_beam_extent / offsets.size
    return Beam(
        vertical=vertical_pattern(sonar),
        horizontal=horizontal_pattern(np.arange(0.0, 32.0, _HORIZONTAL_STEP)),
        seabed=backscatter_table(seabed),
        offsets=offsets,
        level=10 ** (0.1 * (sonar.source_level + receiver.gain)) * width,
        array_length=sonar.array_length,
        beamwidth=sonar.horizontal_beamwidth(sound_speed),
        absorption=0.2 * np.log(10.0) * loss,
        sound_speed=sound_speed,
        surface=0.0 if receiver.surface_loss is None else 10 ** (-0.1 * receiver.surface_loss),
        step=sonar.ray_step,
        inner_angle=float(np.radians(sonar.inner_angle_deg)),
        sample_spacing=sonar.sample_spacing,
    )


@njit(cache=True, parallel=True, error_model="numpy")
def _render(ground, beam, planes, intensity):  # type: ignore[no-untyped-def]
    for k in prange(planes.size):
        for offset in beam.offsets:
            _march(ground, beam, planes[k], (offset, 1.0), intensity[k])
            _march(ground, beam, planes[k], (offset, -1.0), intensity[k])


@njit(**_INLINED)
def _march(ground, beam, plane, ray, echo):  # type: ignore[no-untyped-def]
    """Follow one ray from nadir outward (+1) or inward (-1) and add its energy to the echo."""
    offset, direction = ray
    w = _first_depth(ground, plane)
    last_w, highest = w, 0.0
    last = (0.0, 0.0, 0.0, 0.0, 0.0)
    for node in range(int(beam.sample_spacing * echo.size / beam.step) + 2):
        y = direction * node * beam.step
        next_w, floor = _descend(ground, beam, plane, (offset, y, 2.0 * w - last_w))
        last_w, w = w, next_w
        t, r, density = _density(beam, plane, (offset, y, w), floor)
        if np.isnan(density) or (direction < 0 and -t > beam.inner_angle):
            break
        bounced_r, bounced = _bounced(beam, plane, (offset, y, w), (t, r, density))
        t *= direction
        if node > 0 and t > highest:
            seen = (t - highest) / max(t - highest, t - last[0])
            angle = seen * (t - last[0])
            _deposit(echo, beam.sample_spacing, r + seen * (last[1] - r), r, 0.5 * (density + last[2]) * angle)
            if beam.surface > 0.0:
                start = bounced_r + seen * (last[3] - bounced_r)
                _deposit(echo, beam.sample_spacing, start, bounced_r, 0.5 * (bounced + last[4]) * angle)
            highest = t
        last = (t, r, density, bounced_r, bounced)


@njit(**_INLINED)
def _first_depth(ground, plane):  # type: ignore[no-untyped-def]
    z, _, _, _ = _surface(ground, plane.x, plane.y)
    return (plane.z - z) / -plane.down_z


@njit(**_INLINED)
def _surface(ground, x, y):  # type: ignore[no-untyped-def]
    """Height, slopes and reflectivity of the bilinear surface; NaN outside."""
    column, row = (x - ground.x) / ground.spacing, (y - ground.y) / ground.spacing
    if not (column >= 0.0 and row >= 0.0 and column < ground.z.shape[1] - 1 and row < ground.z.shape[0] - 1):
        return np.nan, np.nan, np.nan, np.nan
    i, j = int(row), int(column)
    a, b = row - i, column - j
    z00, z01, z10, z11 = (
        np.float64(ground.z[i, j]),
        np.float64(ground.z[i, j + 1]),
        np.float64(ground.z[i + 1, j]),
        np.float64(ground.z[i + 1, j + 1]),
    )
    south, north = z00 + b * (z01 - z00), z10 + b * (z11 - z10)
    slope_x = ((1.0 - a) * (z01 - z00) + a * (z11 - z10)) / ground.spacing
    bright = ground.reflectivity
    lower = bright[i, j] + b * (bright[i, j + 1] - bright[i, j])
    upper = bright[i + 1, j] + b * (bright[i + 1, j + 1] - bright[i + 1, j])
    return south + a * (north - south), slope_x, (north - south) / ground.spacing, lower + a * (upper - lower)


@njit(**_INLINED)
def _point(beam, plane, offset, y, w):  # type: ignore[no-untyped-def]
    """In-plane range, along-track shift, and the vector from the array to the point, world axes."""
    q = np.sqrt(y * y + w * w)
    # Footprint of the array: its length in the near field, its beam in the far field.
    width = np.sqrt(beam.array_length**2 + (q * beam.beamwidth) ** 2)
    shift = offset * width
    dx = y * plane.out_x + w * plane.down_x + shift * plane.forward_x
    dy = y * plane.out_y + w * plane.down_y + shift * plane.forward_y
    return width, shift, dx, dy, w * plane.down_z + shift * plane.forward_z


@njit(**_INLINED)
def _descend(ground, beam, plane, ray):  # type: ignore[no-untyped-def]
    """Depth w in the beam plane at which the floor is met, by Newton's method, and the floor there."""
    offset, y, w = ray
    tilt = abs(plane.down_x) + abs(plane.down_y) + abs(offset) * beam.beamwidth
    for _ in range(12):
        _, _, dx, dy, dz = _point(beam, plane, offset, y, w)
        z, slope_x, slope_y, reflectivity = _surface(ground, plane.x + dx, plane.y + dy)
        excess = plane.z + dz - z
        change = excess / (slope_x * plane.down_x + slope_y * plane.down_y - plane.down_z)
        w += change
        if not abs(change) * tilt > 1e-4:
            break
    return w, (slope_x, slope_y, reflectivity)


@njit(**_INLINED)
def _density(beam, plane, ray, floor):  # type: ignore[no-untyped-def]
    """In-plane angle, echo range, and received energy per angle of a point of the floor."""
    offset, y, w = ray
    width, shift, dx, dy, dz = _point(beam, plane, offset, y, w)
    slope_x, slope_y, reflectivity = floor
    r = np.sqrt(dx * dx + dy * dy + dz * dz)
    t = np.arctan2(y, w)
    cosine = (slope_x * dx + slope_y * dy - dz) / (r * np.sqrt(1.0 + slope_x**2 + slope_y**2))
    delay = 2.0 * r / beam.sound_speed
    # The beam that receives has moved and turned since it sent (first order in the delay).
    offset_back = offset + (y * plane.turn_out + w * plane.turn_down - plane.speed_forward) * delay / width
    approach = (y * plane.speed_out + w * plane.speed_down + shift * plane.speed_forward) / r
    vertical = _vertical(beam, t + plane.roll) * _vertical(beam, t + plane.roll + plane.roll_rate * delay)
    horizontal = _horizontal(beam, offset) * _horizontal(beam, offset_back)
    # Two-way spreading r^-4, area r dt width / cos, near field (r beamwidth / width)^2.
    spreading = beam.level * beam.beamwidth**2 / (width * r) * np.exp(-beam.absorption * r)
    density = vertical * horizontal * spreading * reflectivity * _interpolate(beam.seabed, 2048.0 * max(cosine, 0.0))
    return t, r - 0.5 * approach * delay, density


@njit(**_INLINED)
def _bounced(beam, plane, ray, direct):  # type: ignore[no-untyped-def]
    """Echo that meets the sea surface once, out or back: range and energy per angle of the direct one."""
    offset, y, w = ray
    t, r, density = direct
    if not beam.surface > 0.0:
        return r, 0.0
    _, _, dx, dy, dz = _point(beam, plane, offset, y, w)
    # The surface mirrors the array; z is 0 there.
    horizontal, height = np.sqrt(dx * dx + dy * dy), -2.0 * plane.z - dz
    far = np.sqrt(horizontal**2 + height**2)
    upward = np.pi - np.arctan2(horizontal, height) if y >= 0.0 else np.arctan2(horizontal, height) - np.pi
    beams = _vertical(beam, upward + plane.roll) / max(_vertical(beam, t + plane.roll), 1e-12)
    longer = (r / far) ** 2 * np.exp(-0.5 * beam.absorption * (far - r))
    return 0.5 * (r + far), 2.0 * beam.surface * beams * longer * density


@njit(**_INLINED)
def _vertical(beam, angle):  # type: ignore[no-untyped-def]
    return _interpolate(beam.vertical, (angle + np.pi) / VERTICAL_STEP)


@njit(**_INLINED)
def _horizontal(beam, offset):  # type: ignore[no-untyped-def]
    return _interpolate(beam.horizontal, abs(offset) / _HORIZONTAL_STEP)


@njit(**_INLINED)
def _interpolate(table, position):  # type: ignore[no-untyped-def]
    i = min(max(int(position), 0), table.size - 2)
    return table[i] + (min(position, table.size - 1.0) - i) * (table[i + 1] - table[i])


@njit(**_INLINED)
def _deposit(echo, sample_spacing, start, end, energy):  # type: ignore[no-untyped-def]
    """Spread energy evenly over the range bins from start to end."""
    low, high = min(start, end) / sample_spacing, max(start, end) / sample_spacing
    first, last = int(low), int(high)
    if first == last or high - low < 1e-9:
        if first < echo.size:
            echo[first] += energy
        return
    for sample in range(first, min(last + 1, echo.size)):
        share = min(high, sample + 1.0) - max(low, float(sample))
        echo[sample] += energy * share / (high - low)
