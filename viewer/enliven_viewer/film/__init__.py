"""Films and picture sheets of what the viewer shows, encoded beside the drawing."""
