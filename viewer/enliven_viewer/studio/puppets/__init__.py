"""Puppets in the studio: their surfaces in the current pose, control points, key poses and dragging."""
