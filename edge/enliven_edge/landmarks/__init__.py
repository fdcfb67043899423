"""Landmarks of a colour image, lifted into bodies in metres and joined with the bodies from depth.

This is an addition: depth alone tracks without it. MediaPipe runs in a process of its own.
"""
