from .coverage import coverage_of, unposed
from .live import LiveExamples
from .mapping import ExampleMap
from .pairing import guess_joints
from .performer import performed, turned_about_y, yaw_of
from .puppet_examples import examples_of, frame_at, material_of, missing, reference_of
from .puppet_motion import State, clock, in_world, motion_of, pose_of_state, state_of
from .puppet_solve import check_layer, seen_by
from .suggest import Suggested, distance_to, further_poses, suggest_poses
from .symmetric import mirrored_places, partners_of, reflected

__all__ = [
    "ExampleMap",
    "LiveExamples",
    "State",
    "Suggested",
    "check_layer",
    "clock",
    "coverage_of",
    "distance_to",
    "examples_of",
    "frame_at",
    "further_poses",
    "guess_joints",
    "in_world",
    "material_of",
    "mirrored_places",
    "missing",
    "motion_of",
    "partners_of",
    "performed",
    "pose_of_state",
    "reference_of",
    "reflected",
    "seen_by",
    "state_of",
    "suggest_poses",
    "turned_about_y",
    "unposed",
    "yaw_of",
]
