"""Foxglove: a WebSocket server, and the stage as messages of its app."""
