"""The stage on disk: restores characters of viewers, sizes and switches after a restart of the edge."""
