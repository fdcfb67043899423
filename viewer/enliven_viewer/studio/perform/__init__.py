"""Performing in the studio: the link to an edge, the characters on its stage, and recordings."""
