"""Playback: the document of what is shown, its timeline, and poses between two messages."""
