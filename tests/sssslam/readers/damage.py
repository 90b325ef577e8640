"""Damage as files suffer it or enemies do it: cuts, flipped bits, extreme numbers, missing and repeated pieces."""

import struct
from pathlib import Path

import numpy as np

from frontend.recording import Recording
from sssslam.readers import read

EXTREMES = [
    struct.pack(f"{order}{kind}", value)
    for order in "<>"
    for kind, values in {
        "B": (0, 1, 127, 255),
        "H": (0, 1, 32767, 32768, 65535),
        "I": (0, 1, 2**31 - 1, 2**31, 2**32 - 1),
        "f": (0.0, -1.0, 1e38, np.inf, np.nan),
        "d": (0.0, -1.0, 1e308, np.inf, np.nan),
    }.items()
    for value in values
]


def damaged(content: bytes, rng: np.random.Generator, keep: int = 0) -> bytes:
    """The content with a few wounds; its first `keep` bytes, by which the format is told, stay."""
    data = bytearray(content)
    for _ in range(rng.integers(1, 6)):
        # Headers are at the front: half of the wounds are near it.
        reach = len(data) if rng.random() < 0.5 else min(len(data), 2000)
        place = int(rng.integers(min(keep, max(reach - 1, 0)), max(reach, 1)))
        kind = rng.integers(0, 6)
        piece = data[place : place + int(rng.integers(1, 200))]
        if kind == 0 and place < len(data):
            data[place] ^= 1 << int(rng.integers(0, 8))
        elif kind == 1:
            del data[place:]
        elif kind == 2:
            extreme = EXTREMES[rng.integers(0, len(EXTREMES))]
            data[place : place + len(extreme)] = extreme
        elif kind == 3:
            del data[place : place + len(piece)]
        elif kind == 4:
            data[place:place] = piece * int(rng.integers(1, 4))
        else:
            data[place : place + len(piece)] = rng.integers(0, 256, len(piece), dtype=np.uint8).tobytes()
    return bytes(data) or b"\0"


def survivor(path: Path) -> Recording | None:
    """The recording of a damaged file; None where it is refused with an error of one line that names it."""
    try:
        return read(path)
    except ValueError as error:
        assert "\n" not in str(error)  # noqa: PT017  what is not refused must be sound, which `check_sound` tells
        assert str(path) in str(error)  # noqa: PT017
        return None


def check_sound(recording: Recording, max_pings: int) -> None:
    """Whether a recording can be worked with, whatever its file went through."""
    track = recording.trajectory_dr
    assert 1 <= recording.n_pings <= max_pings
    assert np.all(np.diff(track.time) > 0)
    for name in ("time", "x", "y", "z", "roll", "pitch", "yaw"):
        assert np.isfinite(getattr(track, name)).all(), name
    for name in ("sample_spacing", "sound_speed"):
        values = getattr(recording, name)
        assert np.isfinite(values).all(), name
        assert np.all(values > 0), name
    for name in ("altitude", "depth", "speed", "port", "starboard"):
        assert not np.isinf(getattr(recording, name)).any(), name


def check_survival(path: Path, max_pings: int) -> str:
    """Read a damaged file: a sound recording, or an error of one line; gives which."""
    recording = survivor(path)
    if recording is None:
        return "refused"
    check_sound(recording, max_pings)
    return "read"
