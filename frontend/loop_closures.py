"""Loop closures: which submaps to compare; accept, or reject with a reason."""

from dataclasses import dataclass

from frontend.arrays import FloatArray


@dataclass(frozen=True)
class LoopClosure:
    """One candidate and what became of it.

    Parameters
    ----------
    target, source : int
        Submap numbers; the target is the earlier.
    T_target_source : ndarray, shape (4, 4)
        Takes points of the source's level frame to the target's; NaN where no transform was found.
    sigmas : ndarray, shape (6,)
        Standard deviations of the transform in the target frame [rad, rad, rad, m, m, m].
    n_matches, n_inliers : int
        Mutual feature matches, and how many of them agree with the transform.
    correlation : float
        Masked normalised cross-correlation of the heights over the overlap.
    overlap : float
        Share of the smaller submap that the other covers.
    accepted : bool
        Whether the closure enters, or stays in, the pose graph.
    reason : str
        Why not, without a comma; empty when accepted.
    """

    target: int
    source: int
    T_target_source: FloatArray
    sigmas: FloatArray
    n_matches: int
    n_inliers: int
    correlation: float
    overlap: float
    accepted: bool
    reason: str
