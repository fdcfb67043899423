"""Performing in the studio: the connection to an edge, the characters on its stage, and recordings."""
