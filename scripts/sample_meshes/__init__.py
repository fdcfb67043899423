"""Makes the meshes of ``enliven.samples``, as fine as asked; scripts/make_samples.py writes what ships."""
