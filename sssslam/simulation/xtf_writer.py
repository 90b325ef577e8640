"""Recordings as XTF files, so that other tools and our own reader see what a real sonar would have written.

The layouts are pyxtf's. Both sides go into one packet a ping, port from its far end to the nadir as is the custom.
Positions are degrees where the recording has a place on the Earth, else metres of a grid whose origin lies far off: the
format has no word for an unknown position but 0, 0.
"""

import ctypes
import os
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyxtf

from frontend.arrays import AnyArray, Float32Array, FloatArray
from frontend.frames import heading_from_yaw
from frontend.recording import Recording, SonarGeometry
from sssslam.simulation.receiver import SampleType

_SAMPLE_FORMATS = {
    "u1": pyxtf.XTFSampleFormat.byte.value,
    "<u2": pyxtf.XTFSampleFormat.word.value,
    "<f4": pyxtf.XTFSampleFormat.float.value,
}
_GRID_ORIGIN = (500_000.0, 5_000_000.0)
_KNOT = 1852 / 3600


def _layout(structure: type[ctypes.Structure]) -> np.dtype[np.void]:
    """The numpy dtype of a ctypes structure with the fields it inherits."""
    fields = [field for base in reversed(structure.__mro__) for field in vars(base).get("_fields_", [])]
    layout = {
        "names": [field[0] for field in fields],
        "formats": [np.dtype(field[1]) for field in fields],
        "offsets": [getattr(structure, field[0]).offset for field in fields],
        "itemsize": ctypes.sizeof(structure),
    }
    return np.dtype(layout)  # type: ignore[call-overload, no-any-return]


_PING, _BLOCK = _layout(pyxtf.XTFPingHeader), _layout(pyxtf.XTFPingChanHeader)


def write_xtf(recordings: Iterable[Recording], path: str | Path, sample_type: SampleType = "<f4") -> None:
    """Write a dive as one XTF file, piece by piece.

    Parameters
    ----------
    recordings : iterable of Recording
        The pieces of the dive in the order of time; one is in memory at a time.
    path : str or Path
        The file; one that exists is replaced once the new one is whole.
    sample_type : {"u1", "<u2", "<f4"}
        Whole numbers of 8 or 16 bits, or 32-bit floats.

    Raises
    ------
    ValueError
        If there is no recording, its samples do not fit the type, or the file cannot be written.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with temporary.open("wb") as file:
            n_pings = _write(recordings, file, sample_type)
        if n_pings == 0:
            raise ValueError("no recording given, at least one wanted")
        temporary.replace(path)
    except OSError as error:
        raise ValueError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        temporary.unlink(missing_ok=True)


def _write(recordings: Iterable[Recording], file: BinaryIO, sample_type: SampleType) -> int:
    n_pings = 0
    for recording in recordings:
        if n_pings == 0:
            file.write(_file_header(recording, sample_type))
        file.write(_packets(recording, sample_type, n_pings).tobytes())
        n_pings += recording.n_pings
    return n_pings


def _file_header(recording: Recording, sample_type: SampleType) -> bytes:
    header = pyxtf.XTFFileHeader()
    header.FileFormat, header.SystemType = 0x7B, 1
    header.RecordingProgramName, header.RecordingProgramVersion = b"sssslam", b"1"
    header.SonarName, header.ThisFileName = b"simulated", recording.source.encode("ascii", "replace")[:63]
    units = pyxtf.XTFNavUnits.latlon if recording.georeference else pyxtf.XTFNavUnits.meters
    header.NavUnits, header.NumberOfSonarChannels = units.value, 2
    _describe(header.ChanInfo[0], pyxtf.XTFChannelType.port.value, recording.sonar, sample_type)
    _describe(header.ChanInfo[1], pyxtf.XTFChannelType.stbd.value, recording.sonar, sample_type)
    return bytes(header)


def _describe(info: pyxtf.XTFChanInfo, kind: int, sonar: SonarGeometry, sample_type: SampleType) -> None:
    """Fill in a row of the channel table: kHz, degrees, offsets starboard-forward-down; 0 where unknown."""
    is_port = kind == pyxtf.XTFChannelType.port.value
    forward, port, up = sonar.lever_arm_port if is_port else sonar.lever_arm_starboard
    info.TypeOfChannel, info.SubChannelNumber, info.CorrectionFlags, info.UniPolar = kind, kind - 1, 1, 1
    info.BytesPerSample, info.SampleFormat = np.dtype(sample_type).itemsize, _SAMPLE_FORMATS[sample_type]
    info.ChannelName = b"port" if is_port else b"starboard"
    info.VoltScale, info.Frequency = 5.0, np.nan_to_num(sonar.frequency) / 1e3
    info.HorizBeamAngle, info.BeamWidth, info.TiltAngle = np.nan_to_num(
        np.degrees([sonar.horizontal_beamwidth, sonar.vertical_beamwidth, sonar.mounting_depression])
    ).tolist()
    info.OffsetX, info.OffsetY, info.OffsetZ = -port, forward, -up


def _packets(recording: Recording, sample_type: SampleType, first: int) -> AnyArray:
    """One packet a ping: header, then header and samples of each side, padded to 64 bytes as the format wants."""
    samples = (np.dtype(sample_type), (recording.n_samples,))
    fields = [("header", _PING), ("port_block", _BLOCK), ("port", *samples), ("starboard_block", _BLOCK)]
    size = np.dtype([*fields, ("starboard", *samples)]).itemsize
    packet = np.dtype([*fields, ("starboard", *samples), ("padding", "u1", (-size % 64,))])
    packets = np.zeros(recording.n_pings, dtype=packet)
    _fill_header(packets["header"], recording, first)
    packets["header"]["NumBytesThisRecord"] = packet.itemsize
    for channel, side in enumerate(("port", "starboard")):
        _fill_block(packets[f"{side}_block"], recording, channel)
        packets[side] = _samples(getattr(recording, side), sample_type)
    packets["port"] = packets["port"][:, ::-1].copy()
    return packets


def _fill_header(header: AnyArray, recording: Recording, first: int) -> None:
    trajectory = recording.trajectory_dr
    header["MagicNumber"], header["HeaderType"], header["NumChansToFollow"] = 0xFACE, 0, 2
    _fill_time(header, recording.ping_time)
    header["PingNumber"] = header["EventNumber"] = first + np.arange(recording.n_pings)
    # The format's sound velocity is that of range against time: half of the real one.
    header["SoundVelocity"], header["ComputedSoundVelocity"] = 0.5 * recording.sound_speed, recording.sound_speed
    header["SensorXcoordinate"], header["SensorYcoordinate"] = _positions(recording)
    header["ShipXcoordinate"], header["ShipYcoordinate"] = _positions(recording)
    header["SensorSpeed"] = header["ShipSpeed"] = np.nan_to_num(recording.speed) / _KNOT
    header["SensorDepth"] = np.nan_to_num(recording.depth)
    header["SensorPrimaryAltitude"] = np.nan_to_num(recording.altitude)
    header["SensorRoll"], header["SensorPitch"] = np.degrees(trajectory.roll), -np.degrees(trajectory.pitch)
    header["SensorHeading"] = header["ShipGyro"] = np.degrees(heading_from_yaw(trajectory.yaw))


def _fill_time(header: AnyArray, time: FloatArray) -> None:
    hundredths = np.rint(100 * time).astype(np.int64)
    stamp = (hundredths // 100).astype("datetime64[s]")
    day, year = stamp.astype("datetime64[D]"), stamp.astype("datetime64[Y]")
    second_of_day = (stamp - day).astype(np.int64)
    header["Year"] = year.astype(np.int64) + 1970
    header["Month"] = stamp.astype("datetime64[M]").astype(np.int64) % 12 + 1
    header["Day"] = (day - stamp.astype("datetime64[M]")).astype(np.int64) + 1
    header["JulianDay"] = (day - year).astype(np.int64) + 1
    header["Hour"], header["Minute"] = second_of_day // 3600, second_of_day // 60 % 60
    header["Second"], header["HSeconds"] = second_of_day % 60, hundredths % 100


def _positions(recording: Recording) -> tuple[FloatArray, FloatArray]:
    x, y = recording.trajectory_dr.x, recording.trajectory_dr.y
    if recording.georeference is None:
        return x + _GRID_ORIGIN[0], y + _GRID_ORIGIN[1]
    latitude, longitude = recording.georeference.to_geographic(x, y)
    return longitude, latitude


def _fill_block(block: AnyArray, recording: Recording, channel: int) -> None:
    block["ChannelNumber"], block["NumSamples"] = channel, recording.n_samples
    block["SlantRange"] = recording.slant_range_max
    block["TimeDuration"] = 2 * recording.slant_range_max / recording.sound_speed
    intervals = np.diff(recording.ping_time)
    block["SecondsPerPing"] = float(np.median(intervals)) if intervals.size else 0.0
    block["Frequency"] = int(np.nan_to_num(recording.sonar.frequency) / 1e3)


def _samples(echoes: Float32Array, sample_type: SampleType) -> AnyArray:
    """Samples in the file's type; unknown ones are 0 in whole numbers, which know no NaN."""
    if sample_type == "<f4":
        return echoes
    whole, largest = np.rint(np.nan_to_num(echoes)), np.iinfo(sample_type).max
    if whole.size and (whole.min() < 0 or whole.max() > largest):
        raise ValueError(
            f"samples from {whole.min():g} to {whole.max():g} given, 0 to {largest} wanted for {sample_type}"
        )
    return whole.astype(sample_type)
