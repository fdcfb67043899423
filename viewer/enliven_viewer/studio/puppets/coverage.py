"""Computes the distance of every frame of a take from the examples, for the strip of key poses and the
timeline.

Distances are measured between poses of the performer in the body frame, over the paired joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, ExampleCharacter, Project
from enliven.errors import EnlivenError
from enliven.examples.performer import extract_performer_clip
from enliven.examples.puppet_examples import collect_motion_inputs, find_missing_examples
from enliven.examples.puppet_solve import convert_to_reference
from enliven.examples.suggest import SuggestedPoses, distance_to, suggest_further_poses, suggest_poses


@dataclass(frozen=True, eq=False)
class TakeCoverage:
    """How well the key poses cover a take.

    Attributes:
        take: id of the take.
        distances: (F,) distance of each frame from the nearest example, relative to the largest distance
            without examples; zeros without examples.
        frames: frames of the missing key poses, most needed first.
        needed: number of the first entries of ``frames`` that are sufficient.
        remaining_distance: largest distance after adding these key poses, in the unit of ``distances``.
        step: seconds between frames.
    """

    take: str
    distances: Float
    frames: tuple[int, ...]
    needed: int
    remaining_distance: float
    step: float

    @property
    def times(self) -> tuple[float, ...]:
        """Returns the times in the take, in seconds, at which key poses are still needed."""
        return tuple(frame * self.step for frame in self.frames[: self.needed])


class CoverageCache:
    """A cache of the coverage of the last few takes."""

    def __init__(self) -> None:
        self._coverages: dict[tuple[object, ...], tuple[tuple[object, ...], TakeCoverage | None]] = {}
        self._suggestions: dict[tuple[object, ...], tuple[Clip, SuggestedPoses | None, Float]] = {}

    def find_coverage(self, project: Project, puppet: ExampleCharacter, take: str) -> TakeCoverage | None:
        """Returns the coverage of a take by the puppet's examples, or None if the performer never moves."""
        clip = project.takes[take]
        shown = tuple(project.takes[pose.take] for pose in puppet.poses)
        marks = tuple((pose.take, pose.time) for pose in puppet.poses)
        paired = tuple((point.joint, point.vertex) for point in puppet.points)
        values = (clip, puppet.mesh, puppet.symmetry, *shown)
        plays = any(layer.take == take for layer in puppet.layers)
        key = (puppet.id, take, marks, paired, plays)
        cached = self._coverages.get(key)
        if cached is None or any(a is not b for a, b in zip(cached[0], values, strict=True)):
            cached = (values, self._compute_coverage(project, puppet, clip, take))
            self._coverages = {**dict(list(self._coverages.items())[-7:]), key: cached}
        return cached[1]

    def _compute_coverage(
        self, project: Project, puppet: ExampleCharacter, clip: Clip, take: str
    ) -> TakeCoverage | None:
        joints = _choose_joints(puppet, clip)
        without_examples, poses = self._suggest_poses(clip, joints)
        if without_examples is None:
            return None
        solver_poses = _find_solver_points(project, puppet, take)
        example_poses = (
            _find_performer_poses(project, puppet, joints) if solver_poses is None else solver_poses[0]
        )
        if len(example_poses) == 0:
            return TakeCoverage(
                take, np.zeros(len(poses)), without_examples.frames, without_examples.count, 1.0, clip.step
            )
        if solver_poses is not None:
            poses = solver_poses[1]
            try:
                without_examples = suggest_poses(poses)
            except EnlivenError:
                return None
        suggestions = suggest_further_poses(poses, example_poses)
        distances = distance_to(poses, example_poses) / without_examples.gaps[0]
        return TakeCoverage(
            take,
            distances,
            suggestions.frames,
            suggestions.count,
            float(suggestions.gaps[0] / without_examples.gaps[0]),
            clip.step,
        )

    def _suggest_poses(self, clip: Clip, joints: tuple[str, ...]) -> tuple[SuggestedPoses | None, Float]:
        """Returns the suggested key poses of a clip if it has no examples, and the poses of the clip's
        frames.
        """
        key = (clip.id, joints)
        cached = self._suggestions.get(key)
        if cached is None or cached[0] is not clip:
            poses = extract_performer_clip(clip, joints).poses
            try:
                suggested = suggest_poses(poses)
            except EnlivenError:
                suggested = None
            cached = (clip, suggested, poses)
            self._suggestions = {**dict(list(self._suggestions.items())[-3:]), key: cached}
        return cached[1], cached[2]


def _choose_joints(puppet: ExampleCharacter, clip: Clip) -> tuple[str, ...]:
    """Returns the paired joints that the clip has, or all of the clip's joints if there are none."""
    names = set(clip.skeleton.names)
    paired = tuple(dict.fromkeys(point.joint for point in puppet.points if point.joint in names))
    return paired or clip.skeleton.names


def _find_solver_points(project: Project, puppet: ExampleCharacter, take: str) -> tuple[Float, Float] | None:
    """Returns the examples (n, P, 3) and the take's frames (F, P, 3) in the solver's normalised coordinates.
    Returns None if the puppet does not play the take yet.
    """
    number = next((k for k, layer in enumerate(puppet.layers) if layer.take == take), None)
    if number is None or find_missing_examples(project, puppet):
        return None
    try:
        examples, motion_inputs = convert_to_reference(
            collect_motion_inputs(project, puppet, puppet.layers[number])
        )
    except EnlivenError:
        return None
    return examples.sources, motion_inputs.poses


def _find_performer_poses(project: Project, puppet: ExampleCharacter, joints: tuple[str, ...]) -> Float:
    """Returns the performer's poses (n, J, 3) in metres at the key poses of takes that have the joints."""
    poses = []
    for pose in puppet.poses:
        clip = project.takes[pose.take]
        if set(joints) <= set(clip.skeleton.names):
            frame = int(np.clip(round(pose.time / clip.step), 0, len(clip.turns) - 1))
            poses.append(_get_frame_joints(clip, frame, joints))
    return np.array(poses).reshape(-1, len(joints), 3)


def _get_frame_joints(clip: Clip, frame: int, joints: tuple[str, ...]) -> Float:
    """Returns the joints (J, 3) of one frame of a clip, in the body frame."""
    frame_clip = clip.map_values(lambda track: track[frame : frame + 1])
    return np.asarray(extract_performer_clip(frame_clip, joints).poses[0])
