"""A frame before anything is known of its content: checked, reduced, seen as points in the world."""

from enliven_edge.tracking.frame.depth_survey import Survey, survey
from enliven_edge.tracking.frame.frame_check import FrameCheck, flaw_of
from enliven_edge.tracking.frame.frame_timing import Rhythm
from enliven_edge.tracking.frame.observation import (
    Observation,
    WorkingCamera,
    nearest_pixel,
    observe,
    sampled,
    surface_samples,
    world_points,
)
from enliven_edge.tracking.frame.view import View

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
