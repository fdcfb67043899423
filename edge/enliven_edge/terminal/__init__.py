"""Images in a terminal, by the terminal's own image protocol if it has one, otherwise as coloured half
blocks.
"""
