"""Readers of third-party file formats, and the project file."""
