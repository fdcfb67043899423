"""Writers of what other programs open."""
