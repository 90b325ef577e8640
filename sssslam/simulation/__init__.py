"""Recordings with truth: terrain, vehicle, sonar, drift."""
