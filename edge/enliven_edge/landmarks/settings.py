"""Settings of the colour landmarks."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import setting
from enliven_edge.landmarks.lifting import LiftSettings
from enliven_edge.landmarks.mediapipe_source import MediaPipeSettings


@dataclass(frozen=True)
class ColourSettings:
    """Landmarks from the colour image of a depth sensor, joined with the bodies from depth."""

    use: bool = setting(False, "Look at the colour image too, where there is one; costs its time per frame.")
    mediapipe: MediaPipeSettings = setting(MediaPipeSettings, "What finds the landmarks.")
    lift: LiftSettings = setting(LiftSettings, "How landmarks become bodies.")
