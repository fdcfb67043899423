"""Shows images in a terminal: by an image protocol if the terminal supports a protocol, otherwise as coloured
half blocks.
"""
