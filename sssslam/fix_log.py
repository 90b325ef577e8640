"""Fixes of a receiver as they come with the pings."""

import numpy as np

from backend.dead_reckoning import DeadReckoning
from backend.do_no_harm import DoNoHarmConfig
from backend.sensor_reckoning import surface_fixes
from backend.sensor_series import gather_fixes
from frontend.arrays import FloatArray, IntArray
from frontend.recording import Recording
from sssslam.dead_reckoning import on_the_map
from sssslam.fixes import Fixes, fixes_of_receiver


class FixLog:
    """The fixes of a dive that goes on."""

    def __init__(self) -> None:
        self._time: FloatArray = np.zeros(0)
        self._place: FloatArray = np.zeros((0, 2))

    def take(self, chunk: Recording) -> None:
        """Note the fixes that come with some pings.

        Parameters
        ----------
        chunk : Recording
            Its sensors may hold fixes; those that are not later than all noted before are known already.
        """
        found = gather_fixes(on_the_map(chunk))
        if found is None:
            return
        is_new = found.time > self._time[-1] if self._time.size else np.ones(found.time.size, dtype=np.bool_)
        self._time = np.concatenate([self._time, found.time[is_new]])
        self._place = np.concatenate([self._place, found.values[is_new]])

    def n_near(self, time: FloatArray) -> int:
        """Count the fixes that pings stand for.

        Parameters
        ----------
        time : ndarray, shape (N,)
            Time of the pings so far [s].

        Returns
        -------
        n_fixes : int
            Those within a second of a ping; others wait for theirs.
        """
        return len(surface_fixes(self._sensors, time, 1.0))

    def at_anchors(self, anchors: IntArray, dead_reckoning: DeadReckoning, config: DoNoHarmConfig) -> Fixes:
        """Gather the fixes so far at the anchors so far.

        Parameters
        ----------
        anchors : ndarray of int, shape (S,)
            Pings of the anchors.
        dead_reckoning : DeadReckoning
            Moves a fix to its anchor.
        config : DoNoHarmConfig
            How far fixes may differ.

        Returns
        -------
        fixes : Fixes
            As `sssslam.fixes.fixes_at_anchors` gives them of a finished dive.
        """
        return fixes_of_receiver(self._sensors, anchors, dead_reckoning, config)

    @property
    def _sensors(self) -> dict[str, dict[str, FloatArray]]:
        east, north = self._place.T
        return {"gnss": {"time": self._time, "position_x": east, "position_y": north}}
