"""Takes: reads motion clips from motion captures, recordings and possessed meshes, in files of any known
kind.
"""
