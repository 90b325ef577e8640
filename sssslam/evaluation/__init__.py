"""Metrics with units: reconstruction, loop closures, trajectory."""
