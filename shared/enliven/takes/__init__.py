"""Takes: reads motion clips from files of any known kind, such as motion captures, recordings and possessed
meshes.
"""
