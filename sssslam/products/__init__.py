"""Files a run leaves."""
