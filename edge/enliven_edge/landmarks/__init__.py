"""Landmarks of a colour image, lifted into bodies in metres and joined with the bodies from depth.

This is an addition: depth alone tracks without it. MediaPipe runs in a process of its own.
"""

from enliven_edge.landmarks.eye import ColourEye, LevelEye, check_view
from enliven_edge.landmarks.mediapipe_source import MediaPipeSource
from enliven_edge.landmarks.settings import ColourSettings
from enliven_edge.landmarks.source import LandmarkSource

__all__ = ["ColourEye", "ColourSettings", "LandmarkSource", "LevelEye", "MediaPipeSource", "check_view"]
