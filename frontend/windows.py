"""Sliding windows: which pings make a submap."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Window:
    """Pings ``first_ping <= i < end_ping``, with one of them as anchor.

    Parameters
    ----------
    number : int
        Position in the dive; the number of the submap.
    first_ping, end_ping : int
        Half-open range of pings.
    anchor_ping : int
        The reference ping, in the middle of the window.
    """

    number: int
    first_ping: int
    end_ping: int
    anchor_ping: int
