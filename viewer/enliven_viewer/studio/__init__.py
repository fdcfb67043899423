"""The studio: the editor's window, where shapes are sketched, cut, merged, posed and played."""
