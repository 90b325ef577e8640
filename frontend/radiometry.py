"""Radiometry of a dive: what the numbers are, noise floor, range law and beam pattern, shared by every window."""

from dataclasses import dataclass, replace

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import AnyArray, BoolArray, FloatArray, IntArray
from frontend.bottom import Bottom
from frontend.geometry import off_nadir_angle
from frontend.recording import Quantity, Recording

_N_RANGES = 40  # cells of range over which equal angles are compared


class RadiometryConfig(BaseModel):
    """How echoes become intensities and what is taken for known about the sonar."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    exponent: float = Field(
        default=2.0, gt=0, description="Exponent [1] of cos(incidence); 2 is Lambert's law for intensity."
    )
    angle_step: float = Field(
        default=0.035, gt=0, description="Knots of the beam pattern [rad]; two degrees resolve sidelobes."
    )
    n_pings: int = Field(
        default=800, ge=10, description="Pings [1] looked at for the first estimate, spread over the dive."
    )
    n_windows: int = Field(
        default=8,
        ge=0,
        description="Windows [1] reconstructed coarsely to refine the beam pattern: their slopes average out.",
    )
    n_rounds: int = Field(default=2, ge=0, description="Rounds [1] of that refinement; more changes nothing.")
    smoothness: float = Field(
        default=30.0,
        ge=0,
        description="Weight [1] of the beam pattern's second differences between knots; hides speckle.",
    )


@dataclass(frozen=True)
class Tables:
    """Radiometry of the dive as tables: natural logarithms at evenly spaced knots, port and starboard.

    Parameters
    ----------
    log_beam : ndarray, shape (2, K)
        Two-way beam pattern over the angle from the body's nadir.
    angle_first, angle_step : float
        First knot and distance between knots [rad].
    log_range : ndarray, shape (J,)
        Range law: spreading, absorption, what the recorder amplified.
    range_step : float
        Distance between its knots, the first at 0 [m].
    noise : ndarray, shape (2,)
        Noise floor of each side, as intensity.
    exponent : float
        Exponent of the cosine of the incidence angle.
    """

    log_beam: FloatArray
    angle_first: float
    angle_step: float
    log_range: FloatArray
    range_step: float
    noise: FloatArray
    exponent: float


@dataclass(frozen=True)
class Seafloor:
    """How rough and patchy the floor of a dive is.

    Parameters
    ----------
    roughness : float
        C of the smooth relief's power spectral density ``C k^-4`` [1].
    reflectivity : float
        Standard deviation of the natural logarithm of the reflectivity [1].
    length : float
        Its correlation length [m].
    """

    roughness: float = 3e-3
    reflectivity: float = 0.2
    length: float = 5.0


@dataclass(frozen=True)
class Radiometry:
    """What the echoes of a dive mean.

    Parameters
    ----------
    quantity : Quantity
        What the recorded numbers were taken for: intensity or amplitude.
    looks : float
        Independent looks in one recorded sample.
    tables : Tables
        Beam pattern, range law, noise floor, scattering exponent.
    seafloor : Seafloor
        What the echoes say of the floor as a whole.
    """

    quantity: Quantity
    looks: float
    tables: Tables
    seafloor: Seafloor = Seafloor()


def to_intensity(echoes: AnyArray, quantity: Quantity) -> FloatArray:
    """Intensities of recorded numbers.

    Parameters
    ----------
    echoes : ndarray
        Recorded numbers.
    quantity : Quantity
        What they are; a logarithm is in decibels.

    Returns
    -------
    intensity : ndarray of float64
        Squared amplitudes, or powers of ten, or the numbers themselves; NaN where that is not finite.
    """
    values = np.array(echoes, dtype=np.float64)
    if quantity == Quantity.AMPLITUDE:
        values = values**2
    elif quantity == Quantity.LOG:
        with np.errstate(over="ignore"):
            values = 10.0 ** (values / 10.0)
    values[~np.isfinite(values)] = np.nan
    return values


def estimate_radiometry(recording: Recording, bottom: Bottom, config: RadiometryConfig) -> Radiometry:
    """First estimate of a dive's radiometry: the seafloor taken as flat under every ping.

    Parameters
    ----------
    recording : Recording
        The dive.
    bottom : Bottom
        Its first bottom return and altitude.
    config : RadiometryConfig
        What is taken for known.

    Returns
    -------
    radiometry : Radiometry
        To be refined with reconstructed windows.

    Raises
    ------
    ValueError
        If there is no echo at all.
    """
    quantity = recording.sonar.quantity
    if quantity == Quantity.UNKNOWN:
        quantity = _estimate_quantity(recording, bottom)
    chosen = np.unique(np.linspace(0, recording.n_pings - 1, config.n_pings).astype(int))
    some = recording[chosen]
    echoes = to_intensity(np.stack([some.port, some.starboard], axis=1), quantity)
    if not np.any(echoes > 0):
        raise ValueError("the recording holds no echoes: every sample is zero or unknown, some above zero are wanted")
    some_bottom = Bottom(bottom.first_bottom_return[chosen], bottom.altitude[chosen], bottom.altimeter_scale)
    noise = _noise_floor(echoes, some, some_bottom)
    tables = _flat_floor_tables(echoes, some, some_bottom, noise, config)
    return Radiometry(quantity, _looks(recording, bottom, quantity), tables)


def refine(tables: Tables, angle: FloatArray, measured: FloatArray, modelled: FloatArray, smoothness: float) -> Tables:
    """Move the beam pattern so that measured and modelled energy agree angle by angle.

    Parameters
    ----------
    tables : Tables
        The tables behind ``modelled``.
    angle : ndarray, shape (2, K)
        Angle from the body's nadir of each bin of a side [rad]; NaN where nothing is seen.
    measured, modelled : ndarray, shape (2, K)
        Weighted intensities above the noise floor; zero where a bin says nothing.
    smoothness : float
        Weight of second differences.

    Returns
    -------
    tables : Tables
        New beam pattern, all else unchanged.
    """
    log_beam = tables.log_beam.copy()
    for side in range(2):
        good = np.isfinite(angle[side])
        knots = _knots(angle[side][good], tables)
        top = np.bincount(knots, measured[side][good], log_beam.shape[1])
        base = np.bincount(knots, modelled[side][good], log_beam.shape[1])
        known = (top > 0) & (base > 0)
        step = np.log(top[known] / base[known])
        log_beam[side] += _smooth(step, known, base / max(base.sum(), 1e-300) * log_beam.shape[1], smoothness)
    return replace(tables, log_beam=log_beam)


def _knots(angle: FloatArray, tables: Tables) -> IntArray:
    position = np.round((angle - tables.angle_first) / tables.angle_step).astype(np.int64)
    return np.clip(position, 0, tables.log_beam.shape[1] - 1)


def _smooth(values: FloatArray, known: BoolArray, weight: FloatArray, smoothness: float) -> FloatArray:
    """Least squares through the known knots with small second differences; straight lines where nothing is known."""
    n = known.size
    w = np.where(known, np.minimum(weight, 10.0), 0.0) + 1e-9
    target = np.zeros(n)
    target[known] = values
    second = np.diff(np.eye(n), 2, axis=0)
    first = np.diff(np.eye(n), 1, axis=0)
    normal = np.diag(w) + 1e-2 * smoothness * second.T @ second + 1e-4 * first.T @ first
    return np.asarray(np.linalg.solve(normal, w * target))


def _slant_range(recording: Recording) -> FloatArray:
    return np.asarray((np.arange(recording.n_samples) + 0.5) * np.median(recording.sample_spacing), dtype=np.float64)


def _noise_floor(echoes: FloatArray, recording: Recording, bottom: Bottom) -> FloatArray:
    """Shape (2,): mean intensity in the water column, between ringing and bottom; fish and cross-talk left out."""
    slant_range = _slant_range(recording)
    floor = np.empty(2)
    for side in range(2):
        edge = bottom.first_bottom_return[:, side, None]
        water = echoes[:, side][(slant_range > 0.4 * edge) & (slant_range < 0.85 * edge)]
        water = water[np.isfinite(water)]
        median = np.median(water) if water.size else 0.0
        floor[side] = np.mean(water[water <= 6 * median]) if median > 0 else 0.0
    smallest = 1e-6 * float(np.nanmean(echoes))
    return np.asarray(np.maximum(floor, smallest))


def _estimate_quantity(recording: Recording, bottom: Bottom) -> Quantity:
    """Amplitude speckle varies by 0.52 of its mean, intensity speckle by 1; ping-to-ping differences tell."""
    variation = np.sqrt(_variation(recording, bottom, Quantity.INTENSITY, 1))
    return Quantity.INTENSITY if variation > 0.72 else Quantity.AMPLITUDE


def _looks(recording: Recording, bottom: Bottom, quantity: Quantity) -> float:
    """Independent looks a sample, judged on means of eight so that correlated samples count once."""
    return float(np.clip(1.0 / max(_variation(recording, bottom, quantity, 8) * 8, 1e-3), 0.1, 50.0))


def _variation(recording: Recording, bottom: Bottom, quantity: Quantity, n: int) -> float:
    """Squared coefficient of variation of means of n samples, from neighbouring pings on the seafloor."""
    rows = np.unique(np.linspace(0, max(recording.n_pings - 2, 0), 400).astype(int))
    slant_range, ratios = _slant_range(recording), []
    length = recording.n_samples // n * n
    for echoes in (recording.port, recording.starboard):
        pair = [to_intensity(echoes[np.minimum(rows + k, recording.n_pings - 1), :length], quantity) for k in (0, 1)]
        a, b = (p.reshape(len(rows), -1, n).mean(axis=2) for p in pair)
        centre = slant_range[:length].reshape(-1, n).mean(axis=1)
        seen = (centre > 1.5 * bottom.altitude[rows][:, None]) & (a + b > 0)
        ratios.append((2 * (a - b)[seen] ** 2) / (a + b)[seen] ** 2)
    both = np.concatenate(ratios)
    # for a gamma mean of L looks, E[2 (a-b)^2 / (a+b)^2] = 2 / (2 L + 1); solved for 1 / L
    share = float(np.mean(both)) if both.size else 1.0
    return 2 * share / max(2 - share, 1e-6)


def _flat_floor_tables(
    echoes: FloatArray, recording: Recording, bottom: Bottom, noise: FloatArray, config: RadiometryConfig
) -> Tables:
    """Beam pattern over angle and one power of range that explain the mean echoes of a flat floor."""
    slant_range = _slant_range(recording)
    attitude = (recording.trajectory_dr.roll, recording.trajectory_dr.pitch)
    angle = off_nadir_angle(slant_range, bottom.altitude, attitude)
    n_knots = int(np.ceil((np.pi / 2 + 0.6) / config.angle_step)) + 1
    shape = _flat_floor_shape(slant_range, bottom.altitude, config.exponent)[:, None, :]
    usable = np.isfinite(angle) & np.isfinite(echoes) & np.isfinite(shape)
    usable &= slant_range[None, None, :] > 1.05 * bottom.altitude[:, None, None]
    tables = Tables(np.zeros((2, n_knots)), -0.5, config.angle_step, np.zeros(2), 1.0, noise, config.exponent)
    level = np.where(usable, (echoes - noise[None, :, None]) / np.where(usable, shape, 1.0), 0.0)
    log_beam, power = _fit_beam_and_range(_Excess(angle, level, usable), slant_range, tables, config.smoothness)
    range_step = float(slant_range[-1]) / 200
    knots = np.maximum(np.arange(260) * range_step, 0.5)
    return replace(tables, log_beam=log_beam, log_range=-power * np.log(knots), range_step=range_step)


def _flat_floor_shape(slant_range: FloatArray, altitude: FloatArray, exponent: float) -> FloatArray:
    """Shape (N, M): cos^n(incidence) times ground range a metre of slant range; NaN in the water column."""
    cosine = altitude[:, None] / slant_range[None, :]
    sine = np.sqrt(np.where(cosine < 1, 1 - cosine**2, np.nan))
    return np.asarray(cosine**exponent / sine)


@dataclass(frozen=True)
class _Excess:
    """Echoes above the noise floor against those of a flat floor, shape (N, 2, M), and which of them count."""

    angle: FloatArray
    level: FloatArray
    is_usable: BoolArray


def _fit_beam_and_range(
    excess: _Excess, slant_range: FloatArray, tables: Tables, smoothness: float
) -> tuple[FloatArray, float]:
    """Beam pattern, and the power of range that leaves the least spread over range at equal angle."""
    sums, counts, log_range = _histogram(excess, slant_range, tables)
    known = (counts > 0) & (sums > 0)
    log_mean = np.log(np.where(known, sums, 1.0)) - np.log(np.where(known, counts, 1.0))
    weight = np.where(known, counts, 0.0)
    total = weight.sum(axis=2)
    fits = []
    for power in np.linspace(0.0, 5.0, 51):
        level = log_mean + power * log_range
        mean = (weight * level).sum(axis=2) / np.maximum(total, 1e-9)
        spread = float((weight * (level - mean[:, :, None]) ** 2).sum() / max(total.sum(), 1e-9))
        fits.append((spread + 1e-4 * (power - 3.0) ** 2, power, mean))  # spreading alone would be 3
    _, power, mean = min(fits, key=lambda fit: fit[0])
    share = total / np.maximum(total.max(axis=1, keepdims=True), 1e-9)
    beam = [_smooth(mean[k][total[k] > 0], total[k] > 0, 10 * share[k], smoothness) for k in range(2)]
    return np.stack(beam), float(power)


def _histogram(excess: _Excess, slant_range: FloatArray, tables: Tables) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums and counts over (side, angle knot, range), and the logarithm of the ranges."""
    shape = (tables.log_beam.shape[1], _N_RANGES)
    column = (np.arange(slant_range.size) * _N_RANGES // slant_range.size)[None, :]
    sums, counts = np.zeros((2, *shape)), np.zeros((2, *shape))
    for side in range(2):
        good = excess.is_usable[:, side]
        cell = _knots(excess.angle[:, side][good], tables) * _N_RANGES + np.broadcast_to(column, good.shape)[good]
        sums[side] = np.bincount(cell, excess.level[:, side][good], sums[side].size).reshape(shape)
        counts[side] = np.bincount(cell, minlength=sums[side].size).reshape(shape)
    centre = (np.arange(_N_RANGES) + 0.5) * slant_range[-1] / _N_RANGES
    return sums, counts, np.log(centre)
