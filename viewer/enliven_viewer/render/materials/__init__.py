"""Materials on the GPU: material parameters, batches of faces, and textures."""
