"""Why dead reckoning drifts: the errors of heading, velocity, attitude and depth, in grades of equipment."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from frontend.arrays import FloatArray
from sssslam.simulation.presets import lay_over_preset

# Each error in the grades "none", "navigation", "tactical" and "mems". Gyro, heading, scale and noise of the velocity:
# Tang et al., Sensors 2013, and Sensors 17 (2017) 415, table 2; the rest as data sheets of each class state.
_ERRORS = {
    "heading_bias_deg": (0.0, 0.035, 0.15, 2.0),
    "heading_walk_deg": (0.0, 0.002, 0.1, 6.0),
    "heading_deviation_deg": (0.0, 0.0, 0.1, 1.5),
    "velocity_scale": (0.0, 0.0015, 0.0035, 0.0075),
    "misalignment_deg": (0.0, 0.05, 0.1, 0.5),
    "velocity_noise": (0.0, 0.003, 0.005, 0.025),
    "attitude_noise_deg": (0.0, 0.01, 0.05, 0.3),
    "depth_noise": (0.0, 0.01, 0.01, 0.02),
    "depth_bias": (0.0, 0.02, 0.05, 0.1),
    "altimeter_noise": (0.0, 0.02, 0.03, 0.05),
    "gyro_bias_deg": (0.0, 0.01, 1.0, 10.0),
    "gyro_noise_deg": (0.0, 0.002, 0.1, 0.34),
    "accelerometer_bias": (0.0, 3e-4, 3e-3, 0.05),
    "accelerometer_noise": (0.0, 1e-4, 5e-4, 2e-3),
}
GRADES: dict[str, dict[str, Any]] = {
    grade: {name: values[k] for name, values in _ERRORS.items()}
    for k, grade in enumerate(("none", "navigation", "tactical", "mems"))
}
GRADES["mems-no-dvl"] = {**GRADES["mems"], "velocity_scale": 0.03}
_KNOT = 1.0  # seconds between the knots of the heading's random walk


class DriftConfig(BaseModel):
    """Errors of the navigation; what is constant is drawn once a dive with these standard deviations."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    grade: str = Field(default="none", description="Grade whose values fill in what is left out here.")
    heading_bias_deg: float = Field(ge=0, description="Constant error of the heading [deg].")
    heading_walk_deg: float = Field(ge=0, description="Random walk of the heading [deg/sqrt(h)].")
    heading_deviation_deg: float = Field(ge=0, description="Heading error with cosine and sine of the heading [deg].")
    velocity_scale: float = Field(ge=0, description="Relative error of the speed; sound speed and calibration.")
    misalignment_deg: float = Field(ge=0, description="Turn between velocity sensor and compass [deg].")
    velocity_noise: float = Field(ge=0, description="White noise of a velocity [m/s/sqrt(Hz)].")
    attitude_noise_deg: float = Field(ge=0, description="White noise of a roll or pitch [deg].")
    depth_noise: float = Field(ge=0, description="White noise of a depth [m].")
    depth_bias: float = Field(ge=0, description="Constant error of the depth [m]; tide and density.")
    altimeter_noise: float = Field(ge=0, description="White noise of a range to the floor [m].")
    gyro_bias_deg: float = Field(ge=0, description="Constant error of an angular rate [deg/h].")
    gyro_noise_deg: float = Field(ge=0, description="Angle random walk [deg/sqrt(h)].")
    accelerometer_bias: float = Field(ge=0, description="Constant error of an acceleration [m/s2].")
    accelerometer_noise: float = Field(ge=0, description="Velocity random walk [m/s/sqrt(s)].")

    @model_validator(mode="before")
    @classmethod
    def _from_grade(cls, values: Any) -> Any:
        return lay_over_preset(values, "grade", GRADES)


@dataclass(frozen=True)
class Drift:
    """Errors drawn for one dive; angles in radians.

    Parameters
    ----------
    heading_bias : float
        Constant part of the heading error [rad].
    heading_deviation : tuple of float
        Its parts with the cosine and the sine of the yaw [rad].
    heading_walk : ndarray, shape (K,)
        Its random walk at whole seconds since the start [rad].
    velocity_scale, misalignment : float
        Relative error of the speed [1]; turn of the velocity [rad].
    depth_bias : float
        Constant error of the depth [m].
    """

    heading_bias: float
    heading_deviation: tuple[float, float]
    heading_walk: FloatArray
    velocity_scale: float
    misalignment: float
    depth_bias: float

    def heading_error(self, time: FloatArray, yaw: FloatArray) -> FloatArray:
        """Error of the heading.

        Parameters
        ----------
        time, yaw : ndarray, shape (N,)
            Seconds since the start, true yaw [rad].

        Returns
        -------
        error : ndarray, shape (N,)
            To add to the true yaw [rad].
        """
        walk = np.interp(time, _KNOT * np.arange(self.heading_walk.size), self.heading_walk)
        cosine, sine = self.heading_deviation
        return np.asarray(self.heading_bias + walk + cosine * np.cos(yaw) + sine * np.sin(yaw))


def draw_drift(config: DriftConfig, duration: float, rng: np.random.Generator) -> Drift:
    """Draw the errors of one dive.

    Parameters
    ----------
    config : DriftConfig
        Their standard deviations.
    duration : float
        Length of the dive [s].
    rng : Generator
        Source of the errors.

    Returns
    -------
    drift : Drift
        The errors.
    """
    bias, cosine, sine, scale, turn, depth = (float(draw) for draw in rng.standard_normal(6))
    deviation = float(np.radians(config.heading_deviation_deg))
    step = float(np.radians(config.heading_walk_deg)) * np.sqrt(_KNOT / 3600.0)
    return Drift(
        heading_bias=float(np.radians(config.heading_bias_deg)) * bias,
        heading_deviation=(deviation * cosine, deviation * sine),
        heading_walk=np.concatenate([[0.0], np.cumsum(step * rng.standard_normal(int(duration / _KNOT) + 2))]),
        velocity_scale=config.velocity_scale * scale,
        misalignment=float(np.radians(config.misalignment_deg)) * turn,
        depth_bias=config.depth_bias * depth,
    )
