"""Creates the meshes of ``enliven.samples`` at any resolution.

scripts/make_samples.py writes the files that are shipped.
"""
