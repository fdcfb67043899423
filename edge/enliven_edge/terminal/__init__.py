"""Shows images in a terminal, with an image protocol if the terminal supports one, or else as coloured half
blocks.
"""
