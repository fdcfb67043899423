"""Motion from a few example poses: trajectories of control points.

After "Example-based retargeting of human motion to arbitrary mesh models" (2014), section 5: key poses pair
joints of a performer with control points of a mesh, ``spacetime`` solves the trajectories, ``baking`` makes
them other formats'.
"""

from enliven.examples.coverage import coverage_of, unposed
from enliven.examples.live import LiveExamples
from enliven.examples.mapping import ExampleMap
from enliven.examples.pairing import guess_joints
from enliven.examples.performer import performed, turned_about_y, yaw_of
from enliven.examples.puppet_examples import examples_of, frame_at, material_of, missing, reference_of
from enliven.examples.puppet_motion import (
    State,
    clock,
    in_world,
    length_of_puppets,
    motion_of,
    pose_of_state,
    state_of,
)
from enliven.examples.puppet_solve import check_layer, seen_by
from enliven.examples.suggest import Suggested, distance_to, further_poses, suggest_poses
from enliven.examples.symmetric import mirrored_places, partners_of, reflected

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
    "length_of_puppets",
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
