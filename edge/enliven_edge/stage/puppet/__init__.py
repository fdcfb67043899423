"""Puppets are meshes that are animated by a few key poses (example-based retargeting).

Performers drive the control points. The viewer solves the surface.
"""
