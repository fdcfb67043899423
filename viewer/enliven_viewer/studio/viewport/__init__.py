"""The 3D view: its renderer, lens, hits, overlays, colours and the selection."""
