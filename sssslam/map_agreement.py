"""How well the maps of two submaps agree: what the front end can tell the back end about a relative pose."""

from collections.abc import Sequence

import numpy as np

from frontend.anywhere import anywhere
from frontend.arrays import FloatArray
from frontend.chance import joint_chance, significance
from frontend.comparison import Places
from frontend.frames import invert, planar_parameters
from frontend.loop_closures import LoopClosure, LoopClosureConfig
from frontend.overlap import Layers, lay_over
from frontend.pairs import PriorCovariance, predicted_transform
from frontend.priors import Prior
from frontend.submaps import Submap
from frontend.verification import joint_area, joint_reflectivity_area


class MapAgreement:
    """Agreement of submaps' heights; each submap is prepared once, when it is first asked for.

    Parameters
    ----------
    submaps : sequence of Submap
        Their positions are the numbers of the anchors.
    config : LoopClosureConfig
        What of the heights is compared, as the front end does.
    """

    def __init__(self, submaps: Sequence[Submap], config: LoopClosureConfig) -> None:
        self._submaps = submaps
        self._config = config
        self._places = Places(submaps, config.relief, config.search)

    def __call__(self, target: int, source: int, T_target_source: FloatArray) -> float:
        """Significance of the heights' correlation at a relative pose of two bodies.

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
        overlap = lay_over(*layers, planar_parameters(T_levels))
        if overlap.share < self._config.acceptance.min_overlap:
            return float("nan")
        area = joint_area(layers[0].relief, layers[1].relief)
        return float(significance(np.array(overlap.correlation), np.array(overlap.area), area))

    def chance(self, closure: LoopClosure, covariance: PriorCovariance) -> float:
        """Chance that unrelated floors align as well as a closure, in the gate and among the places searched for it.

        Parameters
        ----------
        closure : LoopClosure
            A closure that the front end accepted.
        covariance : callable
            What dead reckoning says of the pose of one submap seen from another.

        Returns
        -------
        chance : float
            A probability where it is small.
        """
        target, source = self._of(closure.target, closure.source)
        overlap = lay_over(target, source, planar_parameters(closure.T_target_source))
        area, area_r = joint_area(target.relief, source.relief), joint_reflectivity_area(target.relief, source.relief)
        by_shape = float(significance(np.array(overlap.correlation), np.array(overlap.area), area))
        by_echo = float(significance(np.array(overlap.reflectivity_correlation), np.array(overlap.area), area_r))
        if closure.is_from_appearance:
            prior, n_places = anywhere(target.relief, source.relief, self._config.pairs.gate), len(self._submaps)
        else:
            T_dr = predicted_transform(self._submaps[closure.target], self._submaps[closure.source])
            prior, n_places = Prior(T_dr, covariance(closure.target, closure.source), self._config.pairs.gate), 1
        return n_places * joint_chance(by_shape, by_echo, (overlap.area, area, area_r), prior)

    def _of(self, target: int, source: int) -> tuple[Layers, Layers]:
        """Rasters of two submaps with their surroundings, as the front end compared them."""
        a, b = self._places.sides(min(target, source), max(target, source))
        return (a.layers, b.layers) if target <= source else (b.layers, a.layers)
