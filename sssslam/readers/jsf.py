"""EdgeTech JSF: the native recordings of EdgeTech side-scan sonars."""

import mmap
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from frontend.recording import Quantity, Recording, SonarGeometry
from sssslam.readers.dives import Pings, read_dives
from sssslam.readers.jsf_messages import Messages, index_messages
from sssslam.readers.jsf_navigation import read_navigation, sound_speeds
from sssslam.readers.jsf_pings import ANALYTIC, ENVELOPE, SonarData, read_sonar_data, sample_intervals
from sssslam.readers.jsf_sides import choose_sides, match_sides, read_lines, take_channel
from sssslam.readers.lines import fill_width
from sssslam.readers.xtf_channels import Channel, Pair


def read_jsf_files(paths: Sequence[Path], channels: str | None) -> list[Recording]:
    """Read JSF files into one local frame.

    Parameters
    ----------
    paths : sequence of Path
        The files.
    channels : str or None
        ``"3,4"`` for two channel numbers counted from 1 in the order of subsystem and side, ``"900kHz"`` for the pair
        next to a frequency, or None for the finer pair.

    Returns
    -------
    recordings : list of Recording
        One a file, in the order of time.

    Raises
    ------
    ValueError
        If a file gives no recording.
    """
    return read_dives(paths, partial(_read_pings, channels))


def _read_pings(channels: str | None, path: Path, data: mmap.mmap) -> Pings:
    del path  # a JSF is one file
    messages = index_messages(data)
    sonar_data = read_sonar_data(data, messages)
    if not len(sonar_data):
        raise ValueError(f"the file has no whole side-scan message ({_kinds(messages)}); type 80 of a side is wanted")
    pair, listing = choose_sides(sonar_data, channels)
    sides = [take_channel(sonar_data, channel) for channel in (pair.port, pair.starboard)]
    n_met = max(int((sonar_data.channel == int(channel.info)).sum()) for channel in pair.channels)
    rows = match_sides(*sides)
    port, starboard = (side[k] if len(side) else side for side, k in zip(sides, rows, strict=True))
    main = port if len(port) else starboard
    navigation, is_geographic, notes = read_navigation(data, messages, main)
    sound_speed, more = sound_speeds(main.header)
    n_dropped = n_met - len(main)
    lines = fill_width(*(read_lines(data, side, len(main)) for side in (port, starboard)))
    return Pings(
        port=lines[0],
        starboard=lines[1],
        sample_spacing=sample_intervals(main.header) * sound_speed / 2,
        sound_speed=sound_speed,
        stamp=main.stamp,
        navigation=navigation,
        sonar=SonarGeometry(frequency=pair.channels[0].frequency, quantity=_quantity(main)),
        notes=(*_notes(messages, listing, pair, n_dropped), *more, *notes),
        n_dropped=n_dropped,
        is_geographic=is_geographic,
    )


def _kinds(messages: Messages) -> str:
    kinds, counts = np.unique(messages.header["type"], return_counts=True)
    listing = [f"{n} messages of type {kind}" for kind, n in zip(kinds.tolist(), counts.tolist(), strict=True)]
    return ", ".join(listing[:10]) or "no whole message"


def _quantity(pings: SonarData) -> Quantity:
    """Envelopes are amplitudes, and so are magnitudes of analytic data; what else there is does not say."""
    is_amplitude = int(pings.header["DataFormat"][0]) in (ENVELOPE, ANALYTIC) if len(pings) else False
    return Quantity.AMPLITUDE if is_amplitude else Quantity.UNKNOWN


def _notes(messages: Messages, listing: list[Channel], pair: Pair, n_dropped: int) -> list[str]:
    notes = []
    if len(listing) > len(pair.channels):
        others = ", ".join(str(c) for c in listing if c not in pair.channels)
        notes.append(f"channels {pair} are taken; the file also has {others}")
    for side in ("port", "starboard"):
        if getattr(pair, side) is None:
            notes.append(f"the file has no {side} channel: that side is unknown")
    notes += messages.skipped.notes("messages")
    if n_dropped:
        notes.append(f"pings dropped, for lack of a partner on the other side or odd length: {n_dropped}")
    return notes
