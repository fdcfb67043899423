"""Edits of possessed meshes: cut, merged, copied and posed with their motion kept."""
