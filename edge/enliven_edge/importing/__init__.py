"""Readers of foreign recordings, found by name or by the files' content."""
