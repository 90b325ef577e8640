"""Radiometry of a dive: what the numbers are, noise floor, range law and beam pattern, shared by every window."""

from dataclasses import dataclass, replace

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import AnyArray, FloatArray, IntArray
from frontend.bottom import Bottom
from frontend.noise import floor_over_range, mean_floor
from frontend.range_law import Excess, fit_beam_and_range
from frontend.recording import Quantity, Recording
from frontend.transfer import Transfer, estimate_transfer, to_intensity

__all__ = ["Radiometry", "RadiometryConfig", "Seafloor", "Tables", "estimate_radiometry", "to_intensity"]

_N_RANGE_KNOTS = 260


class RadiometryConfig(BaseModel):
    """How echoes become intensities and what is taken for known about the sonar."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    exponent: float = Field(
        default=2.0, gt=0, description="Exponent [1] of cos(incidence) that is usual; 2 is Lambert's law for intensity."
    )
    exponent_spread: float = Field(
        default=0.01,
        gt=0,
        description="Standard deviation [1] of its logarithm of floors about it; 0.01 holds it. 0.35 looks for it: "
        "floors of exponent 4 gain, but boulders on a floor of 2 are taken for 3.4 and lose half of their closures.",
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
        What the recorded numbers were taken for: intensity, amplitude or logarithm.
    looks : float
        Independent looks in one recorded sample.
    tables : Tables
        Beam pattern, range law, noise floor, scattering exponent.
    transfer : Transfer or None
        How numbers become intensities, and how sure that is; None: as usual for the quantity.
    noise_floor : ndarray, shape (2, J), or None
        Noise floor of each side over the ranges of ``tables.log_range``, as intensity. None: the same at all ranges.
    seafloor : Seafloor
        What the echoes say of the floor as a whole.
    """

    quantity: Quantity
    looks: float
    tables: Tables
    transfer: Transfer | None = None
    noise_floor: FloatArray | None = None
    seafloor: Seafloor = Seafloor()

    def intensity(self, echoes: AnyArray) -> FloatArray:
        """Intensities of recorded numbers, in the unit of the tables; NaN where a number is not finite."""
        return (self.transfer or Transfer(self.quantity)).intensity(echoes)

    @property
    def words(self) -> str:
        """What the samples were taken for and why, for people."""
        words = self.transfer.words if self.transfer else f"Samples taken for {self.quantity}."
        return f"{words} Each has {self.looks:.2g} looks."


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
    transfer = estimate_transfer(recording)
    chosen = np.unique(np.linspace(0, recording.n_pings - 1, config.n_pings).astype(int))
    some = recording[chosen]
    echoes = transfer.intensity(np.stack([some.port, some.starboard], axis=1))
    if not np.any(np.stack([some.port, some.starboard]) != 0) or not np.any(echoes > 0):
        raise ValueError("the recording holds no echoes: every sample is zero or unknown, some above zero are wanted")
    some_bottom = _chosen(bottom, chosen)
    noise = mean_floor(echoes, some, some_bottom)
    tables = _flat_floor_tables(echoes, some, some_bottom, noise, config)
    knots = np.asarray(np.arange(_N_RANGE_KNOTS) * tables.range_step, dtype=np.float64)
    over_range = floor_over_range(echoes, some, some_bottom, (knots, noise))
    return Radiometry(transfer.quantity, _looks(recording, bottom, transfer), tables, transfer, over_range)


def _chosen(bottom: Bottom, pings: IntArray) -> Bottom:
    last = bottom.last_usable_sample
    return replace(
        bottom,
        first_bottom_return=bottom.first_bottom_return[pings],
        altitude=bottom.altitude[pings],
        is_found=None if bottom.is_found is None else bottom.is_found[pings],
        last_usable_sample=None if last is None else last[pings],
    )


def _slant_range(recording: Recording) -> FloatArray:
    """Shape (N, M): middles of the samples."""
    return np.asarray((np.arange(recording.n_samples) + 0.5)[None, :] * recording.sample_spacing[:, None])


def _looks(recording: Recording, bottom: Bottom, transfer: Transfer) -> float:
    """Independent looks a sample, judged on means of eight so that correlated samples count once."""
    return float(np.clip(1.0 / max(_variation(recording, bottom, transfer, 8) * 8, 1e-3), 0.1, 50.0))


def _variation(recording: Recording, bottom: Bottom, transfer: Transfer, n: int) -> float:
    """Squared coefficient of variation of means of n samples, from neighbouring pings on the seafloor."""
    rows = np.unique(np.linspace(0, max(recording.n_pings - 2, 0), 400).astype(int))
    length, ratios = recording.n_samples // n * n, []
    centre = (np.arange(length // n) + 0.5)[None, :] * n * recording.sample_spacing[rows][:, None]
    for echoes in (recording.port, recording.starboard):
        pair = [transfer.intensity(echoes[np.minimum(rows + k, recording.n_pings - 1), :length]) for k in (0, 1)]
        a, b = (p.reshape(len(rows), -1, n).mean(axis=2) for p in pair)
        seen = (centre > 1.5 * bottom.altitude[rows][:, None]) & (a + b > 0)
        ratios.append((2 * (a - b)[seen] ** 2) / (a + b)[seen] ** 2)
    both = np.concatenate(ratios)
    # for a gamma mean of L looks, E[2 (a-b)^2 / (a+b)^2] = 2 / (2 L + 1); solved for 1 / L
    share = float(np.mean(both)) if both.size else 1.0
    return 2 * share / max(2 - share, 1e-6)


def _flat_floor_tables(
    echoes: FloatArray, recording: Recording, bottom: Bottom, noise: FloatArray, config: RadiometryConfig
) -> Tables:
    """Beam pattern over angle and range law that explain the mean echoes of a flat floor."""
    slant_range = _slant_range(recording)
    angle, shape = _flat_floor(slant_range, recording, bottom, config.exponent)
    usable = np.isfinite(angle) & np.isfinite(echoes) & np.isfinite(shape)[:, None, :]
    usable &= (slant_range > 1.05 * bottom.altitude[:, None])[:, None, :]
    if bottom.last_usable_sample is not None:
        usable &= np.arange(recording.n_samples) <= bottom.last_usable_sample[:, :, None]
    safe = np.where(np.isfinite(shape), shape, 1.0)[:, None, :]
    excess = Excess(angle, np.where(usable, (echoes - noise[None, :, None]) / safe, 0.0), usable, slant_range)
    n_knots = int(np.ceil((np.pi / 2 + 0.6) / config.angle_step)) + 1
    log_beam, law = fit_beam_and_range(excess, -0.5, config.angle_step, n_knots)
    range_step = float(slant_range.max()) / 200
    log_range = law(np.maximum(np.arange(_N_RANGE_KNOTS) * range_step, 0.5))
    return Tables(log_beam, -0.5, config.angle_step, log_range, range_step, noise, config.exponent)


def _flat_floor(
    slant_range: FloatArray, recording: Recording, bottom: Bottom, exponent: float
) -> tuple[FloatArray, FloatArray]:
    """Angles (N, 2, M) from the body's nadir, and cos^n(incidence) times ground range a metre of slant range (N, M)."""
    attitude = recording.trajectory_dr
    cosine = (bottom.altitude / np.cos(attitude.pitch))[:, None] / slant_range
    cosine = np.where(cosine < 1, cosine, np.nan)
    from_vertical = np.arccos(cosine)
    roll = attitude.roll[:, None]
    level = bottom.altitude[:, None] / slant_range
    shape = level**exponent / np.sqrt(1 - cosine**2)
    return np.stack([from_vertical - roll, from_vertical + roll], axis=1), shape
