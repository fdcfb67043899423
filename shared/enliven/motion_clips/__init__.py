"""Motion clips: reads motion captures, recordings, tracked people and recorded characters, as clips and
characters of a project.
"""
