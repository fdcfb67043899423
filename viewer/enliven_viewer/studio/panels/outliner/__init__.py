"""The outliner and the numbers of the selection: rows with visibility and lock, fields with units."""
