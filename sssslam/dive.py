"""A dive as a user names it: files, channels, and the navigation to give it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from frontend.recording import Recording
from sssslam.readers import read


@dataclass(frozen=True)
class Dive:
    """What is to be read.

    Parameters
    ----------
    recordings : sequence of Path
        Its files.
    channels : str or None
        Which channels of a dual-frequency file.
    nav : Path or None
        Navigation recorded beside the sonar.
    clock_offset : str or None
        Seconds to add to its times, or ``"estimate"``.
    positions : str
        ``"recorded"`` or ``"dead-reckoned"``.
    """

    recordings: Sequence[Path]
    channels: str | None = None
    nav: Path | None = None
    clock_offset: str | None = None
    positions: str = "recorded"

    def read_track(self) -> Recording:
        """As `read`, for work that needs a vehicle that moves.

        Returns
        -------
        recording : Recording
            The dive.

        Raises
        ------
        ValueError
            If it stands still from the first ping to the last.
        """
        recording = self.read()
        if recording.n_pings > 1 and recording.trajectory_dr.distance[-1] == 0:
            raise ValueError(
                f"{recording.source or 'the recording'}: the position is the same, or unknown, in all "
                f"{recording.n_pings} pings; --nav FILE, or --navigation dead-reckoned by heading and speed, is wanted"
            )
        return recording

    def read(self) -> Recording:
        """Read its files and give them the navigation that was asked for.

        Returns
        -------
        recording : Recording
            The dive; rebuilt positions have the recorded ones as truth.
        """
        recording = read(*self.recordings, channels=self.channels)
        if self.nav is None and self.clock_offset is None and self.positions == "recorded":
            return recording
        from sssslam.navigation.choice import NavigationChoice, Source, navigate

        return navigate(recording, NavigationChoice(self.nav, self.clock_offset, Source(self.positions)))
