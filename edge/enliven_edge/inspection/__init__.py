"""Debug images and films for technicians: the tracker's bodies and messages drawn over the depth image."""
