"""Scanning in the studio: a stage's camera is carried around an object, which becomes a character."""
