"""Reads and writes the project file of enliven."""
