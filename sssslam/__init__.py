"""sssslam: from a side-scan sonar recording to a corrected track and a map of the seafloor."""

__version__ = "0.1.0"
