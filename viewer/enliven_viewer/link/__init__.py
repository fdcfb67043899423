"""The link to edges and takes: receives messages, synchronises clocks and sends requests."""
