"""The sonar of a scene: what it sends, hears and records."""

from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from frontend.recording import Quantity, SonarGeometry
from sssslam.simulation.presets import lay_over_preset
from sssslam.simulation.sonar_presets import PRESETS


class SonarConfig(BaseModel):
    """A side-scan sonar with a line array on each side."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    preset: str = Field(default="400kHz", description="Preset whose values fill in what is left out here.")
    frequency: float = Field(gt=1e4, lt=5e6, description="Centre frequency [Hz].")
    array_length: float = Field(gt=0, description="Length of the arrays [m]; sets the horizontal beam.")
    source_level: float = Field(description="Level on the beam's axis [dB re 1 uPa at 1 m].")
    noise_level: float = Field(description="Noise in the receiver's band after the array's gain [dB re 1 uPa].")
    ping_rate: float = Field(gt=0, description="Pings a second [1/s]; at most sound speed / (2 range).")
    range_max: float = Field(gt=0, le=2000, description="Slant range of the last sample's far edge [m].")
    sample_spacing: float = Field(ge=1e-3, description="Slant range between samples [m].")
    vertical_beamwidth_deg: float = Field(gt=0, lt=180, description="One-way -3 dB width of the fan [deg].")
    depression_deg: float = Field(ge=0, lt=90, description="The fan's axis below the horizontal [deg].")
    vertical_shape: Literal["gaussian", "line"] = Field(
        default="gaussian", description="Main lobe; line: sinc^2, sidelobes."
    )
    sidelobe_level: float = Field(default=-25.0, lt=0, description="Level outside the main lobe, one way [dB re axis].")
    lever_arm_port: tuple[float, float, float] = Field(
        default=(0.0, 0.1, -0.05), description="Port array, body frame [m]."
    )
    lever_arm_starboard: tuple[float, float, float] = Field(
        default=(0.0, -0.1, -0.05), description="Starboard array [m]."
    )
    squint_deg: float = Field(default=0.0, gt=-45, lt=45, description="Arrays turned forward of broadside [deg].")
    motion: Literal["travel-time", "stop-and-hop"] = Field(
        default="travel-time", description="Whether the vehicle moves on while the sound travels, as it does, or waits."
    )
    n_sub_beams: int = Field(default=3, ge=1, le=999, description="Rays side by side over the horizontal beam.")
    sub_beam_extent: float = Field(
        default=0.75, gt=0, le=16, description="Rays reach so many -3 dB widths off the axis."
    )
    ray_step: float = Field(ge=1e-3, description="Horizontal step along a ray [m]; well below the terrain's spacing.")
    inner_angle_deg: float = Field(default=30.0, ge=0, lt=90, description="An array looks this far past nadir [deg].")

    @model_validator(mode="before")
    @classmethod
    def _from_preset(cls, values: Any) -> Any:
        return lay_over_preset(values, "preset", PRESETS)

    @property
    def n_samples(self) -> int:
        """Number of samples a side."""
        return max(1, round(self.range_max / self.sample_spacing))

    def horizontal_beamwidth(self, sound_speed: float) -> float:
        """One-way -3 dB width of the horizontal beam in the far field [rad]."""
        return float(2 * np.arcsin(min(1.0, 0.443 * sound_speed / self.frequency / self.array_length)))

    def geometry(self, sound_speed: float, quantity: Quantity) -> SonarGeometry:
        """The sonar as a recording describes it."""
        return SonarGeometry(
            frequency=self.frequency,
            horizontal_beamwidth=self.horizontal_beamwidth(sound_speed),
            vertical_beamwidth=float(np.radians(self.vertical_beamwidth_deg)),
            mounting_depression=float(np.radians(self.depression_deg)),
            lever_arm_port=self.lever_arm_port,
            lever_arm_starboard=self.lever_arm_starboard,
            quantity=quantity,
        )
