"""The parts of the method with everything filled in from the data, for use one at a time."""

from frontend.bottom import find_bottom
from frontend.features import Features
from frontend.features import describe as describe_with
from frontend.reconstruction import calibrate, method_of
from frontend.recording import Recording
from frontend.submaps import Submap
from frontend.windows import Window
from sssslam.config import Config, resolve


def reconstruct(recording: Recording, config: Config | None = None) -> Submap:
    """Reconstruct the seafloor that some pings saw, as one submap.

    Parameters
    ----------
    recording : Recording
        The pings of one window, such as ``recording[400:700]``; calibrated by themselves.
    config : Config, optional
        Settings.

    Returns
    -------
    submap : Submap
        In the level frame of the middle ping.
    """
    config = resolve(config or Config(), recording)
    window = Window(0, 0, recording.n_pings, recording.n_pings // 2)
    bottom = find_bottom(recording, config.bottom)
    radiometry = calibrate(recording, [window], bottom, config.radiometry, config.reconstruction.joint)
    return method_of(config.reconstruction)(recording, window, bottom, radiometry)


def describe(submap: Submap, config: Config | None = None) -> Features:
    """Features of a submap that are the same from every heading.

    Parameters
    ----------
    submap : Submap
        A reconstructed submap.
    config : Config, optional
        Settings.

    Returns
    -------
    features : Features
        Keypoints with their descriptors.
    """
    return describe_with(submap, (config or Config()).features)
