"""Rigs that a file holds: links, trees of bones, and the shapes that they become."""
