"""Sources of motion: shows a take's skeleton next to the shapes, and finds parts of shapes that the take
could drive.
"""
