"""What was skipped: the bytes of a file that belong to no whole packet, and where they are."""

from dataclasses import dataclass

import numpy as np

from frontend.arrays import IntArray


@dataclass(frozen=True)
class Skipped:
    """Bytes between, before and behind the whole packets of a file.

    Parameters
    ----------
    n_bytes : int
        How many.
    n_places : int
        In how many places.
    first : int
        Where the first of them is, counted from the start of the file [bytes].
    n_before : int
        Whole packets before it.
    """

    n_bytes: int = 0
    n_places: int = 0
    first: int = 0
    n_before: int = 0

    def notes(self, packets: str) -> list[str]:
        """What to tell of it.

        Parameters
        ----------
        packets : str
            What packets are called in this format.

        Returns
        -------
        notes : list of str
            One sentence; none where nothing was skipped.
        """
        if not self.n_bytes:
            return []
        where = f"at byte {self.first}, behind {self.n_before} whole {packets}"
        places = where if self.n_places == 1 else f"in {self.n_places} places, the first {where}"
        return [f"{self.n_bytes} bytes are damaged or cut off and are skipped: {places}"]


def find_skipped(starts: IntArray, sizes: IntArray, begin: int, end: int) -> Skipped:
    """Find what the whole packets of a file leave out.

    Parameters
    ----------
    starts : ndarray of int, shape (K,)
        Where they start, in order [bytes].
    sizes : ndarray of int, shape (K,)
        Their sizes; none reaches into the next [bytes].
    begin, end : int
        Where the first should start and the last should end [bytes].

    Returns
    -------
    skipped : Skipped
        The bytes of that stretch that are in none of them.

    Examples
    --------
    >>> find_skipped(np.array([4, 10]), np.array([6, 5]), 4, 20)
    Skipped(n_bytes=5, n_places=1, first=15, n_before=2)
    """
    after = np.concatenate([[begin], starts + sizes])
    gaps = np.append(starts, end) - after
    places = np.flatnonzero(gaps > 0)
    if not places.size:
        return Skipped()
    first = int(places[0])
    return Skipped(int(gaps[places].sum()), len(places), int(after[first]), first)
