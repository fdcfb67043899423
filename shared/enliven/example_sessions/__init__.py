"""Sessions of example poses as text files: a mesh, its control points, key poses and takes."""
