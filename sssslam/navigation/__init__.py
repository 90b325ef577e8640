"""Navigation beside the sonar: files of it, clocks, and tracks rebuilt from fewer sensors."""
