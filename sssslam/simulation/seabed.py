"""How the seabed scatters sound back."""

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from frontend.arrays import FloatArray

_N_COSINES = 2049


class _Law(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Lambert(_Law):
    """Backscatter ``mu cos^n`` of the incidence angle."""

    law: Literal["lambert"] = "lambert"
    strength: float = Field(
        default=-27.0, description="10 log10 mu [dB]; -27 is Mackenzie's, sediments span -40 to -20."
    )
    exponent: float = Field(default=2.0, ge=1, le=6, description="Power of the cosine; 2 is Lambert's law.")

    def backscatter(self, incidence: FloatArray) -> FloatArray:
        """Backscattering cross-section per unit area and solid angle at incidence angles [rad]."""
        return np.asarray(10 ** (0.1 * self.strength) * np.cos(incidence) ** self.exponent)


class Gsab(_Law):
    """Generic seafloor acoustic backscatter: ``A exp(-theta^2 / 2 B^2) + C cos^D``, specular near nadir (Lurton)."""

    law: Literal["gsab"] = "gsab"
    specular: float = Field(default=-15.0, description="10 log10 A [dB]; strength at normal incidence.")
    specular_width_deg: float = Field(default=6.0, gt=0, le=20, description="B [deg]; smooth mud 3, sand 6, gravel 15.")
    strength: float = Field(default=-27.0, description="10 log10 C [dB]; as Lambert's mu.")
    exponent: float = Field(default=2.0, ge=1, le=6, description="D; 2 is Lambert's law.")

    def backscatter(self, incidence: FloatArray) -> FloatArray:
        """Backscattering cross-section per unit area and solid angle at incidence angles [rad]."""
        specular = 10 ** (0.1 * self.specular) * np.exp(-0.5 * (incidence / np.radians(self.specular_width_deg)) ** 2)
        return np.asarray(specular + 10 ** (0.1 * self.strength) * np.cos(incidence) ** self.exponent)


Seabed = Annotated[Lambert | Gsab, Field(discriminator="law")]


def backscatter_table(law: Seabed) -> FloatArray:
    """Tabulate backscatter over the cosine of incidence, as an integral over solid angle needs it.

    Parameters
    ----------
    law : Seabed
        The scattering law.

    Returns
    -------
    table : ndarray, shape (2049,)
        ``backscatter / cos`` at cosines from 0 to 1 in equal steps; the first entry is that of the second cosine.
    """
    cosine = np.linspace(0.0, 1.0, _N_COSINES)
    cosine[0] = cosine[1]
    return law.backscatter(np.arccos(cosine)) / cosine
