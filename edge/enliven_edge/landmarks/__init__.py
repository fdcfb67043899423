"""Landmarks of a colour image, lifted to bodies in metres and fused with the bodies from depth.

This is optional, because depth alone is enough for tracking. MediaPipe runs in a separate process.
"""
