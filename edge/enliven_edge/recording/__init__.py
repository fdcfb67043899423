"""The recording of a performance (a take), split into parts. Old parts are deleted when space is short."""
