"""Films and contact sheets of the viewer's images. A background thread encodes them."""
