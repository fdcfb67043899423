"""Overdub: adds a live or recorded performance to a project, as takes and layers over the existing motion."""
