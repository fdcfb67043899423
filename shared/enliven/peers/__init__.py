"""Network discovery and clock synchronisation between programs."""
