"""Overlays on an image: flat shapes and text, glowing marks, lines of matches, tubes of graphs."""
