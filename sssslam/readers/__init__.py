"""Recordings from files: one module a format, chosen by content."""
