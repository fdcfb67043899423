"""Performing in the studio: the link to an edge, its stage, recordings, and the panels for them."""
