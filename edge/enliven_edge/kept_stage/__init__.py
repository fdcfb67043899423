"""The stage on disk: characters of viewers, sizes and switches come back after a restart of the edge."""
