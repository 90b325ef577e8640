"""Absorption of sound in water."""

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray


class WaterConfig(BaseModel):
    """The water sound runs through, the same everywhere."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    sound_speed: float = Field(default=1500.0, gt=1300, lt=1700, description="Sound speed [m/s]; straight rays.")
    temperature: float = Field(default=10.0, ge=-2, le=40, description="Temperature [deg C]; absorption depends on it.")
    salinity: float = Field(default=35.0, ge=0, le=45, description="Practical salinity; 0 in a lake.")
    depth: float = Field(default=50.0, ge=0, le=11000, description="Depth at which absorption is taken [m].")
    acidity: float = Field(default=8.0, gt=6, lt=9, description="pH; boric acid's share below 10 kHz.")


def absorption(frequency: ArrayLike, water: WaterConfig) -> FloatArray:
    """Absorption of sound in sea water and fresh water.

    Parameters
    ----------
    frequency : array_like
        Frequency [Hz].
    water : WaterConfig
        The water.

    Returns
    -------
    absorption : ndarray
        Loss of level over one way [dB/m].

    Notes
    -----
    Francois & Garrison, J. Acoust. Soc. Am. 72 (1982) 1879, :doi:`10.1121/1.388673`; with its own sound-speed formula.
    """
    f, t, s, depth = np.asarray(frequency, dtype=np.float64) / 1e3, water.temperature, water.salinity, water.depth
    kelvin, c = 273.0 + t, 1412.0 + 3.21 * t + 1.19 * s + 0.0167 * depth
    f_boric = 2.8 * np.sqrt(s / 35.0) * 10 ** (4.0 - 1245.0 / kelvin)
    f_sulphate = 8.17 * 10 ** (8.0 - 1990.0 / kelvin) / (1.0 + 0.0018 * (s - 35.0))
    boric = 8.86 / c * 10 ** (0.78 * water.acidity - 5.0)
    sulphate = 21.44 * s * (1.0 + 0.025 * t) / c * (1.0 - 1.37e-4 * depth + 6.2e-9 * depth**2)
    viscous = _viscosity(t) * (1.0 - 3.83e-5 * depth + 4.9e-10 * depth**2)
    relaxation = boric * f_boric / (f_boric**2 + f**2) + sulphate * f_sulphate / (f_sulphate**2 + f**2)
    return np.asarray((relaxation + viscous) * f**2 * 1e-3)


def _viscosity(t: float) -> float:
    if t <= 20.0:
        return 4.937e-4 - 2.59e-5 * t + 9.11e-7 * t**2 - 1.5e-8 * t**3
    return 3.964e-4 - 1.146e-5 * t + 1.45e-7 * t**2 - 6.5e-10 * t**3
