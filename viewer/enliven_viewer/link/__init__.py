"""The connection to edges: receives messages, estimates clock offsets and sends requests."""
