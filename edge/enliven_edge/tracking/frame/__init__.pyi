from .depth_survey import Survey, survey
from .frame_check import FrameCheck, flaw_of
from .frame_timing import Rhythm
from .observation import (
    Observation,
    WorkingCamera,
    nearest_pixel,
    observe,
    sampled,
    surface_samples,
    world_points,
)
from .view import View

__all__ = [
    "FrameCheck",
    "Observation",
    "Rhythm",
    "Survey",
    "View",
    "WorkingCamera",
    "flaw_of",
    "nearest_pixel",
    "observe",
    "sampled",
    "surface_samples",
    "survey",
    "world_points",
]
