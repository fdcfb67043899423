"""Sounds to perform along with: read, mixed and played in sync with the playhead."""
