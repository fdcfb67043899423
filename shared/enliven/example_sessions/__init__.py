"""Sessions of example-based retargeting as text files with a mesh, its control points, key poses and
takes."""
