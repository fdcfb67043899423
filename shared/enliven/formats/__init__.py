"""Readers of files that other programs wrote, and the project file."""
