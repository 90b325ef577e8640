"""Health of a recording: what is in it, and what looks wrong before any work is spent on it."""

from frontend.recording import Recording
from sssslam.health.echoes import examine_echoes
from sssslam.health.finding import Finding, Health
from sssslam.health.pings import examine_pings
from sssslam.health.sensors import examine_sensors
from sssslam.health.track import examine_track

__all__ = ["Finding", "Health", "examine"]


def examine(recording: Recording) -> Health:
    """Examine a recording.

    Parameters
    ----------
    recording : Recording
        The recording.

    Returns
    -------
    health : Health
        What it holds and what looks suspicious.
    """
    rows: list[tuple[str, str]] = []
    findings: list[Finding] = []
    for look in (examine_pings, examine_track, examine_sensors, examine_echoes):
        for line in look(recording):
            findings.append(line) if isinstance(line, Finding) else rows.append(line)
    return Health(tuple(rows), tuple(findings))
