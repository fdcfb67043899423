from .reduction import DepthSurvey as DepthSurvey, is_same as is_same, known_pixels as known_pixels
from .reduction import survey as survey
from .frame_check import FrameCheck as FrameCheck, find_flaw as find_flaw
from .frame_check import FrameTiming as FrameTiming
from .observation import (
    ImageView as ImageView,
    Observation as Observation,
    SeenPerson as SeenPerson,
    WorkingCamera as WorkingCamera,
    nearest_pixel as nearest_pixel,
    observe as observe,
    sampled as sampled,
    side_by_side as side_by_side,
    surface_samples as surface_samples,
    world_points as world_points,
)
from .observation import FrameView as FrameView
