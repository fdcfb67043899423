"""Every number of the studio that an artist may want to change."""

from __future__ import annotations

from dataclasses import dataclass

from enliven.settings import setting
from enliven_viewer.settings import RenderSettings


@dataclass(frozen=True)
class StudioSettings:
    """The settings of the studio's window."""

    render: RenderSettings = setting(RenderSettings, "How the picture is made.")
    width: int = setting(1360, "Width of the window.", unit="pixels", low=640, high=16384)
    height: int = setting(820, "Height of the window.", unit="pixels", low=480, high=16384)
    reach: float = setting(
        11.0, "How near a click must be to a joint or bone.", unit="pixels", low=1, high=80
    )
    snap: float = setting(
        26.0, "A root that is dragged this near to a node is merged with it.", unit="pixels", low=1, high=200
    )
    frame_step: float = setting(1 / 30, "One step of the arrow keys.", unit="seconds", low=0.001, high=1)
    shortest: float = setting(
        2.0, "Length of a timeline on which nothing moves.", unit="seconds", low=0.1, high=600
    )
    autosave: float = setting(20.0, "Seconds between two recovery files.", unit="seconds", low=1, high=3600)
    toast: float = setting(6.0, "How long a message stays.", unit="seconds", low=1, high=60)
    ghosts: int = setting(3, "Ghosts on each side of the playhead.", low=0, high=20)
    ghost_step: float = setting(
        0.25, "Time between two ghosts where no key poses are.", unit="seconds", low=0.02, high=10
    )
    trail: float = setting(
        1.0, "How far trails go on each side of the playhead.", unit="seconds", low=0.05, high=30
    )
    matches: int = setting(6, "Thumbnails of matches that are offered.", low=1, high=24)
