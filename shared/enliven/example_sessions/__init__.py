"""Text-file sessions of example-based retargeting: a mesh, its control points, key poses and takes."""
