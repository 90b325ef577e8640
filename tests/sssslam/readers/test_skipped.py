"""What was skipped: counted, placed, and said in one sentence."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sssslam.readers.skipped import Skipped, find_skipped


def test_nothing_skipped_is_not_mentioned():
    assert find_skipped(np.array([0, 10]), np.array([10, 5]), 0, 15).notes("packets") == []


def test_one_place_and_several_are_told_with_the_first():
    assert Skipped(5, 1, 15, 2).notes("packets") == [
        "5 bytes are damaged or cut off and are skipped: at byte 15, behind 2 whole packets"
    ]
    assert "in 3 places, the first at byte 15, behind 2 whole frames" in Skipped(9, 3, 15, 2).notes("frames")[0]


def test_a_file_without_a_whole_packet_is_skipped_whole():
    nothing = np.zeros(0, dtype=np.int64)
    assert find_skipped(nothing, nothing, 1024, 5000) == Skipped(3976, 1, 1024, 0)


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(1, 9)), max_size=20), st.integers(0, 5), st.integers(0, 50))
def test_every_byte_is_in_a_packet_or_skipped(pieces, tail, begin):
    gaps, sizes = (np.array([piece[k] for piece in pieces], dtype=np.int64) for k in (0, 1))
    starts = begin + np.cumsum(gaps + sizes) - sizes
    skipped = find_skipped(starts, sizes, begin, begin + int((gaps + sizes).sum()) + tail)
    assert skipped.n_bytes == gaps.sum() + tail
    assert skipped.n_places == np.count_nonzero(np.append(gaps, tail))
