"""Puppets in the studio: their surfaces as they stand, control points, key poses and dragging."""
