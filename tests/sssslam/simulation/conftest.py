"""One array over a floor that is given as a function, for echoes that can be worked out by hand."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from frontend.arrays import FloatArray
from frontend.trajectory import Trajectory
from sssslam.simulation.planes import Mounting, Rates, at_rest, beam_planes
from sssslam.simulation.receiver import ReceiverConfig
from sssslam.simulation.renderer import make_beam, render
from sssslam.simulation.seabed import Lambert, Seabed
from sssslam.simulation.sonar import SonarConfig
from sssslam.simulation.terrain import Terrain, make_grid

ALTITUDE = 12.0


def trajectory_at(*, roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, z: float = ALTITUDE) -> Trajectory:
    """One pose above the origin."""
    return Trajectory(*(np.array([float(value)]) for value in (0.0, 0.0, 0.0, z, roll, pitch, yaw)))


class Bench:
    """A test bench: an omnidirectional, knife-edge sonar by default, over a flat floor at z = 0."""

    def __init__(self) -> None:
        self.height: Callable[[FloatArray, FloatArray], FloatArray] = lambda x, y: 0.0 * (x + y)
        self.reflectivity: Callable[[FloatArray, FloatArray], FloatArray] = lambda x, y: 1.0 + 0.0 * (x + y)
        self.spacing, self.size, self.sound_speed, self.absorption = 0.25, 130.0, 1500.0, 0.0
        self.seabed: Seabed = Lambert(strength=0.0)
        self.receiver = ReceiverConfig(gain=0.0)
        self.options: dict[str, Any] = {
            "source_level": 0.0,
            "sidelobe_level": -1e-9,
            "lever_arm_port": (0.0, 0.0, 0.0),
            "lever_arm_starboard": (0.0, 0.0, 0.0),
            "array_length": 1e-6,
            "frequency": 4e6,
            "n_sub_beams": 1,
            "sub_beam_extent": 0.01,
            "inner_angle_deg": 0.0,
            "range_max": 50.0,
        }

    @property
    def sonar(self) -> SonarConfig:
        """The sonar with this bench's options."""
        return SonarConfig.model_validate(self.options)

    def terrain(self) -> Terrain:
        """The floor on its grid."""
        grid = make_grid((self.size, self.size), self.spacing)
        x, y = grid.x[None, :], grid.y[:, None]
        surface = (function(x, y).astype(np.float32) for function in (self.height, self.reflectivity))
        return Terrain(*surface, self.spacing, (float(grid.x[0]), float(grid.y[0])))

    def echo(self, side: float = 1.0, rates: Rates | None = None, **pose: float) -> FloatArray:
        """Mean intensity of one ping, port (1) or starboard (-1), shape (M,)."""
        sonar = self.sonar
        beam = make_beam(sonar, self.receiver, self.seabed, self.sound_speed, self.absorption)
        arm = sonar.lever_arm_port if side > 0 else sonar.lever_arm_starboard
        mounting = Mounting(arm, side, float(np.radians(sonar.squint_deg)))
        planes = beam_planes(trajectory_at(**pose), rates or at_rest(1), mounting)
        return render(self.terrain(), beam, planes, sonar.n_samples)[0]

    def ranges(self) -> FloatArray:
        """Edges of the range bins [m], shape (M + 1,)."""
        return self.sonar.sample_spacing * np.arange(self.sonar.n_samples + 1)


@pytest.fixture
def bench() -> Bench:
    """A fresh test bench."""
    return Bench()
