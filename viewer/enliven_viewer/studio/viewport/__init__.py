"""Display and picking in the viewport: lens, hits, overlays, colours, playback length and the selection."""
