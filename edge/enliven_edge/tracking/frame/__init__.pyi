from .depth_survey import DepthSurvey, survey
from .frame_check import FrameCheck, flaw_of
from .frame_timing import FrameTiming
from .observation import (
    ImageView,
    Observation,
    SeenPerson,
    WorkingCamera,
    nearest_pixel,
    observe,
    sampled,
    surface_samples,
    world_points,
)
from .view import FrameView

__all__ = [
    "DepthSurvey",
    "FrameCheck",
    "FrameTiming",
    "FrameView",
    "ImageView",
    "Observation",
    "SeenPerson",
    "WorkingCamera",
    "flaw_of",
    "nearest_pixel",
    "observe",
    "sampled",
    "surface_samples",
    "survey",
    "world_points",
]
