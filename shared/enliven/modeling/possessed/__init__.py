"""Edits of possessed meshes that keep their motion: cutting, merging, copying and posing."""
