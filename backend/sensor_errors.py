"""How wrong each sensor may be: what the inertial filter must know beyond the drift model."""

from pydantic import BaseModel, ConfigDict, Field


class SensorErrorsConfig(BaseModel):
    """Errors of single sensors, and the filter's step; defaults for a MEMS unit, as nobody says better."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    gyro_bias_sd: float = Field(
        default=5e-5, ge=0, description="Constant error of a turn rate [rad/s]; 10 deg/h, MEMS; tactical 1 deg/h."
    )
    gyro_noise: float = Field(
        default=1e-4, gt=0, description="Angle random walk [rad/sqrt(s)]; 0.34 deg/sqrt(h), MEMS; tactical 0.1."
    )
    accelerometer_bias_sd: float = Field(
        default=0.05, ge=0, description="Constant error of an acceleration [m/s2]; 5 mg, MEMS; tactical 0.3 mg."
    )
    accelerometer_noise: float = Field(
        default=2e-3, gt=0, description="Velocity random walk [m/s/sqrt(s)]; MEMS; tactical a quarter of it."
    )
    compass_noise: float = Field(
        default=3e-3,
        gt=0,
        description="White noise of a heading sample [rad]; 0.2 deg, beside bias, walk and deviation.",
    )
    depth_noise: float = Field(
        default=0.02, gt=0, description="White noise of a depth sample [m]; repeatability of a pressure sensor."
    )
    gnss_sd: float = Field(
        default=1.0, gt=0, description="Error of a fix on each axis [m]; a receiver with corrections at the surface."
    )
    speed_noise: float = Field(
        default=0.05, gt=0, description="White noise of a speed through the water [m/s]; counted propeller turns."
    )
    slip_sd: float = Field(
        default=0.05, gt=0, description="Sideways speed through the water [m/s] where only a speed log tells speed."
    )
    current_sd: float = Field(
        default=0.3, gt=0, description="Current on each axis [m/s] where only a speed log tells speed; coastal water."
    )
    turn_noise: float = Field(
        default=0.02, gt=0, description="Unmeasured turning [rad/sqrt(s)] where no gyro answers; an AUV's steering."
    )
    acceleration_noise: float = Field(
        default=0.1, gt=0, description="Unmeasured acceleration [m/s/sqrt(s)] where no accelerometer answers."
    )
    gate_probability: float = Field(
        default=0.99999,
        gt=0,
        lt=1,
        description="Share of true velocities and fixes [1] that the filter takes; a fish or a false lock is outside.",
    )
    epoch: float = Field(
        default=0.5, gt=0, description="Time between updates of the filter [s]; what comes in between is averaged."
    )
