"""Foxglove: a WebSocket server that sends the stage to the Foxglove app."""
