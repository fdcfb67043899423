"""Films and contact sheets of the viewer's images; a thread encodes while the next image is drawn."""
