"""A navigation log: what a file beside the sonar says of the vehicle, each quantity at times of its own."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from sssslam.navigation.series import Series

DEGREES, LOCAL, GRID = ("longitude", "latitude"), ("x", "y"), ("easting", "northing")
QUANTITIES = (*DEGREES, *LOCAL, *GRID, "z", "roll", "pitch", "yaw", "depth", "altitude", "speed")


@dataclass(frozen=True)
class NavigationLog:
    """Navigation from a file beside the sonar.

    Parameters
    ----------
    source : str
        Name of the file.
    series : dict of str to Series
        Any of `QUANTITIES`: longitude and latitude [deg]; x, y in the local frame of the recording, easting and
        northing of a grid, z up, depth below the surface, altitude above the seafloor [m]; roll (starboard down), pitch
        (nose down) and yaw (counter-clockwise from east) [rad]; speed [m/s].
    notes : tuple of str
        What was assumed, left out or repaired.
    """

    source: str
    series: Mapping[str, Series]
    notes: tuple[str, ...] = ()

    @property
    def place(self) -> tuple[str, str] | None:
        """Names of the two coordinates that give the position; None where the log has none."""
        return next((pair for pair in (DEGREES, LOCAL, GRID) if all(name in self.series for name in pair)), None)

    @property
    def span(self) -> tuple[float, float]:
        """First and last time [s]."""
        return min(s.time[0] for s in self.series.values()), max(s.time[-1] for s in self.series.values())

    def shifted(self, offset: float) -> "NavigationLog":
        """The log on another clock.

        Parameters
        ----------
        offset : float
            Added to its times [s].

        Returns
        -------
        log : NavigationLog
            The same values, later by the offset.
        """
        return replace(self, series={name: Series(s.time + offset, s.values) for name, s in self.series.items()})
