"""How well the maps of two submaps agree: what the front end can tell the back end about a relative pose."""

from collections.abc import Sequence

from frontend.arrays import FloatArray
from frontend.comparison import Places
from frontend.frames import invert
from frontend.loop_closures import LoopClosureConfig
from frontend.overlap import Layers
from frontend.submaps import Submap
from frontend.verification import significance_at


class MapAgreement:
    """Agreement of submaps' heights; each submap is prepared once, when it is first asked for.

    Parameters
    ----------
    submaps : sequence of Submap
        Their positions are the numbers of the anchors.
    config : LoopClosureConfig
        What of the heights is compared, as the front end does.
    places : Places, optional
        What the front end made ready of these submaps to compare them.
    """

    def __init__(self, submaps: Sequence[Submap], config: LoopClosureConfig, places: Places | None = None) -> None:
        self._submaps = submaps
        self._config = config
        self._places = places or Places(submaps, config.relief, config.search)

    def __call__(self, target: int, source: int, T_target_source: FloatArray) -> float:
        """Significance of the maps' correlation, by relief or both witnesses, at a relative pose of two bodies.

        Parameters
        ----------
        target, source : int
            Positions of the submaps.
        T_target_source : ndarray, shape (4, 4)
            Body pose of the source's anchor seen from the body of the target's.

        Returns
        -------
        agreement : float
            Standard deviations above chance; NaN where the submaps overlap too little to tell.
        """
        a, b = self._submaps[target], self._submaps[source]
        T_levels = a.T_submap_body @ T_target_source @ invert(b.T_submap_body)
        layers = self._of(target, source)
        significance, area = significance_at(*layers, T_levels)
        least = self._config.acceptance.min_overlap * min(side.relief.area for side in layers)
        return significance if area >= least > 0 else float("nan")

    def _of(self, target: int, source: int) -> tuple[Layers, Layers]:
        """Rasters of two submaps with their surroundings, as the front end compared them."""
        a, b = self._places.sides(min(target, source), max(target, source))
        return (a.layers, b.layers) if target <= source else (b.layers, a.layers)
