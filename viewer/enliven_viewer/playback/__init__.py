"""Playback: the displayed document, its timeline, and interpolation between two messages."""
