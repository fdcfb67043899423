"""Display and picking in the viewport: camera lens, hit testing, overlays, colours, and the selection."""
