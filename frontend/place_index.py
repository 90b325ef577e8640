"""Place index: which places hold descriptors like those of a new one, without looking at every place."""

import numpy as np
from scipy.fft import dct
from scipy.spatial import cKDTree

from frontend.arrays import FloatArray, IntArray

_N_COEFFICIENTS = 2  # of each histogram: four in five of the variance, and few enough for a tree to be of use
_N_BINS = 11  # of a histogram; three of them make an FPFH
_MOST_OF_A_PLACE = 120  # descriptors kept and asked about: more rank places no better
_N_NEAREST = 12  # descriptors that a new one votes for
_APPROXIMATION = 1.0  # a neighbour this much farther than the nearest will do: votes are many


class PlaceIndex:
    """Descriptors of places in k-d trees of doubling size, so that a place is added and asked about in little time.

    Notes
    -----
    Trees of equal size are merged as digits of a binary counter carry (Bentley and Saxe 1980): each descriptor is
    sorted anew log n times, and a question goes to log n trees. Histograms are compared by their lowest cosine
    coefficients.
    """

    def __init__(self) -> None:
        self._trees: list[_Tree] = []
        self._n_places = 0

    def __len__(self) -> int:
        return self._n_places

    def add(self, descriptors: FloatArray) -> None:
        """Add a place; its number is that of the places before it.

        Parameters
        ----------
        descriptors : ndarray, shape (K, 33)
            FPFH of its keypoints.
        """
        points = compact(descriptors)
        self._trees.append(_Tree(points, np.full(len(points), self._n_places), 1))
        self._n_places += 1
        while len(self._trees) > 1 and self._trees[-2].n_places <= self._trees[-1].n_places:
            second, first = self._trees.pop(), self._trees.pop()
            self._trees.append(first.merged(second))

    def votes(self, descriptors: FloatArray) -> FloatArray:
        """Rank all places by how alike their descriptors are.

        Parameters
        ----------
        descriptors : ndarray, shape (K, 33)
            FPFH of a new place.

        Returns
        -------
        votes : ndarray, shape (n_places,)
            Descriptors of each place among the nearest to the new ones, over the root of how many the place has; 0
            everywhere where there are none.
        """
        points = compact(descriptors)
        if not len(points) or not any(len(tree.points) for tree in self._trees):
            return np.zeros(self._n_places)
        distance, places = (np.concatenate(a, axis=1) for a in zip(*(t.near(points) for t in self._trees), strict=True))
        nearest = np.argsort(distance, axis=1, kind="stable")[:, :_N_NEAREST]
        votes = np.bincount(np.take_along_axis(places, nearest, axis=1).ravel(), minlength=self._n_places)
        return np.asarray(votes / np.sqrt(np.maximum(self._sizes, 1.0)))

    @property
    def _sizes(self) -> IntArray:
        """Number of descriptors of each place."""
        return np.bincount(np.concatenate([tree.places for tree in self._trees]), minlength=self._n_places)


class _Tree:
    """Descriptors of some places that follow one another, sorted when first asked."""

    def __init__(self, points: FloatArray, places: IntArray, n_places: int) -> None:
        self.points, self.places, self.n_places = points, places, n_places
        self._tree: cKDTree | None = None

    def merged(self, other: "_Tree") -> "_Tree":
        """Both as one."""
        points = np.concatenate([self.points, other.points])
        return _Tree(points, np.concatenate([self.places, other.places]), self.n_places + other.n_places)

    def near(self, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """Distances of the nearest to each point and the places they lie in, each shape (len(points), k)."""
        k = min(_N_NEAREST, len(self.points))
        if not k:
            return np.empty((len(points), 0)), np.empty((len(points), 0), dtype=np.int64)
        self._tree = self._tree or cKDTree(self.points, balanced_tree=False, compact_nodes=False)
        distance, nearest = self._tree.query(points, k=k, eps=_APPROXIMATION)
        nearest = nearest.reshape(-1, k)
        return np.asarray(distance).reshape(-1, k), self.places[nearest]


def compact(descriptors: FloatArray) -> FloatArray:
    """Short form of descriptors for comparing many of them.

    Parameters
    ----------
    descriptors : ndarray, shape (K, 11 H)
        H histograms of 11 bins; three make an FPFH.

    Returns
    -------
    points : ndarray, shape (L, 2 H)
        The lowest cosine coefficients of each histogram, its sum left out, of at most 120 of the descriptors.
    """
    step = max(-(-len(descriptors) // _MOST_OF_A_PLACE), 1)
    kept = np.asarray(descriptors[::step], dtype=np.float64)
    n_histograms = kept.shape[1] // _N_BINS
    lowest = dct(kept.reshape(-1, n_histograms, _N_BINS), norm="ortho", axis=2)[:, :, 1 : 1 + _N_COEFFICIENTS]
    return np.asarray(lowest.reshape(-1, n_histograms * _N_COEFFICIENTS))
