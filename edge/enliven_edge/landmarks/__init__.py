"""Landmarks of a colour image, lifted to bodies in metres and fused with the bodies from depth.

This is optional: depth alone tracks without it. MediaPipe runs in a separate process.
"""
