"""Meshes moved by a few example poses: performers drive control points, and the surface follows in the
viewer.
"""
