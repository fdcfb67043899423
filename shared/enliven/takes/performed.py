"""Converts a performance, recorded or live, into takes and layers of a project.

    project, names = add_performance(project, performed, begin)     # begin: the sensor's clock at 0 seconds

Each performer becomes a take. Each character that performers moved plays the new motion. A rigged shape gets
layers on the bones that moved. A possessed mesh gets the motion of its nodes, which can be solved again. A
puppet gets a layer with its performer's take. The new motion is added to the existing motion, or replaces it
during the recording (punch-in). Characters that are not in the project yet are added.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from enliven.document import (
    Character,
    Clip,
    ExampleCharacter,
    GraphCharacter,
    Pose,
    Project,
    PuppetLayer,
    RiggedCharacter,
    unused,
)
from enliven.formats.rig.rig import play_clip
from enliven.frames import BodyFrame
from enliven.modeling.edits import group_as_take
from enliven.modeling.possessed.even_steps import even_times, interpolate_linearly
from enliven.motion.layers.retarget import bind_chain, set_travel
from enliven.rotation import IDENTITY, from_matrix, remove_sign_jumps
from enliven.takes.body_takes import holds_from_frames
from enliven.takes.live_layer import compose_rotations, local_rotations, make_single_bone_chain
from enliven.takes.overdub import add_overdub_layer, has_motion
from enliven.takes.performers import MergedPerformers, merge_performers
from enliven.takes.possessed import add_character_motion
from enliven.takes.punch_in import PunchIn, punch_bones
from enliven.takes.recorded import TakeSettings, clips_of_frames
from enliven.takes.rigged import shape_and_clip_from_poses
from enliven.wire import HoldMessage

_MIN_POSES = 2
"""Minimum number of recorded poses of a character that was performed."""
_MIN_MOTION = 0.005
"""Minimum change, in metres or in entries of a rotation matrix, that counts as motion. It is ten times the
quantization step of transmitted poses."""
_MIN_ROTATION_RADIANS = 0.01
"""Minimum rotation of a bone, radians (half a degree). Transmitted rotations have finer steps."""

Key = tuple[str, int]
"""The id and the revision of a character."""


_UNSPLIT_TAKE_SETTINGS = TakeSettings(gap=math.inf)
"""Settings that give each performer a single take, even if the tracker lost the performer for a
while."""
ONLOOKER_SUFFIX = " onlooker"
"""Suffix of a take's name, before its number, if its performer was attached to no character while other
performers were."""


@dataclass
class PerformedMotion:
    """The motion of performers and characters over a period.

    Attributes:
        name: name of the takes that are created from the motion.
        since_ns: start time, nanoseconds of the sensor's clock. Frames and attachments may begin earlier.
        frames: frames with tracked performers, in the order of time.
        events: events of performers who attach to or release characters, in the order of time.
        characters: the characters by id and revision.
        poses: the poses of each character, ordered by time.
    """

    name: str
    since_ns: int = 0
    frames: list[BodyFrame] = field(default_factory=list)
    events: list[HoldMessage] = field(default_factory=list)
    characters: dict[Key, Character] = field(default_factory=dict)
    poses: dict[Key, list[Pose]] = field(default_factory=dict)

    def cut_at(self, time_ns: int) -> PerformedMotion:
        """Returns the part of the performance up to a time of the sensor's clock, nanoseconds."""
        poses = {
            key: [pose for pose in track if pose.time_ns <= time_ns] for key, track in self.poses.items()
        }
        return replace(
            self,
            frames=[frame for frame in self.frames if frame.time_ns <= time_ns],
            events=[event for event in self.events if event.time_ns <= time_ns],
            poses={key: track for key, track in poses.items() if track},
        )

    @property
    def moved_characters(self) -> list[Key]:
        """The characters that moved."""
        return [key for key, poses in self.poses.items() if len(poses) >= _MIN_POSES and _is_moving(poses)]


@dataclass(frozen=True)
class PerformedCharacter:
    """The performance of one character.

    Attributes:
        key: its id and revision on the stage.
        performed: the whole performance.
        merged: the performers after re-identification, with one id per person.
        begin: time of the sensor's clock at 0 seconds of the project, nanoseconds.
        replaces: True if the performance replaces the earlier motion between its begin and its end.
    """

    key: Key
    performed: PerformedMotion
    merged: MergedPerformers
    begin: int
    replaces: bool

    @property
    def character(self) -> Character:
        """The version of the character that was on the stage."""
        return self.performed.characters[self.key]

    @property
    def poses(self) -> list[Pose]:
        """Its poses, ordered by time."""
        return self.performed.poses[self.key]

    def span(self, project: Project) -> PunchIn:
        """Returns the time span of the motion, in seconds of the project."""
        first, last = (1e-9 * (pose.time_ns - self.begin) for pose in (self.poses[0], self.poses[-1]))
        return PunchIn.from_interval(project, first, last)


def add_performance(
    project: Project, performed: PerformedMotion, begin: int, *, replaces: bool = False, beside: str = ""
) -> tuple[Project, tuple[str, ...]]:
    """Adds takes and layers of a performance to a project. Returns the project, and the ids of the new
    content.

    The new layers become an alternative in an existing or new group of alternative takes
    (:mod:`enliven.modeling.edits.take_comping`).

    Args:
        begin: time of the sensor's clock at 0 seconds of the project, nanoseconds.
        replaces: True if the recording replaces the earlier motion of the moved characters between its begin
            and end. If False, both motions play.
        beside: name of the group of alternative takes to which the recording is added. Empty creates a new
            group.

    Raises:
        InputError: if the poses of a character are inconsistent.
    """
    new_ids, old_project = list[str](), project
    own_frames = [frame for frame in performed.frames if frame.time_ns >= performed.since_ns]
    merged_performers = merge_performers(own_frames, performed.events)
    for clip in _performer_clips(merged_performers, performed):
        project = project.with_takes(replace(clip, id=unused(clip.id, project.takes)))
        new_ids.append(list(project.takes)[-1])
    for key in performed.moved_characters:
        motion = PerformedCharacter(key, performed, merged_performers, begin, replaces)
        existing = project.characters.get(key[0])
        add = None if existing is None else RECORDERS.get(existing.kind)
        extended = None if add is None else add(project, existing, motion)
        if extended is None:
            project, name = _add_character(project, motion)
        else:
            project, name = extended, key[0]
        new_ids.append(name)
    return group_as_take(old_project, project, performed.name, beside or performed.name), tuple(
        dict.fromkeys(new_ids)
    )


def _performer_clips(merged: MergedPerformers, performed: PerformedMotion) -> list[Clip]:
    """Returns one clip for each performer. Performers who were attached to no character, while others were,
    are named onlookers.
    """
    ids = {
        performer for event in performed.events for performer in (event.body, event.former, *event.holders)
    }
    holding = {merged.people[performer] for performer in ids if performer in merged.people}
    actors = [performer for performer in merged.person_ids if performer in holding or not holding]
    others = [performer for performer in merged.person_ids if performer not in actors]
    clips_by_person = {
        performer: clips_of_frames(
            merged.select_person_frames(performer), performed.name, _UNSPLIT_TAKE_SETTINGS
        )[:1]
        for performer in actors + others
    }
    clips = list[Clip]()
    for people, name in ((actors, performed.name), (others, f"{performed.name}{ONLOOKER_SUFFIX}")):
        person_clips = [clip for performer in people for clip in clips_by_person[performer]]
        several = len(person_clips) > 1
        clips += [
            replace(clip, id=f"{name} {n}" if several else name) for n, clip in enumerate(person_clips, 1)
        ]
    return clips


def _add_node_motion(project: Project, shape: GraphCharacter, motion: PerformedCharacter) -> Project | None:
    """Adds the new motion of a possessed mesh to its earlier motion. Returns None if no earlier motion
    remains.
    """
    if not has_motion(project, shape):
        return None
    span = motion.span(project)
    # Muted alternatives may be enabled again, so they must be kept.
    has_muted = any(layer.muted for layer in shape.playing)
    if motion.replaces and not has_muted and not span.moves_outside(project, shape.playing):
        return None
    performed, punch = motion.performed, span if motion.replaces else None
    holds = holds_from_frames(performed.frames, performed.events, unused(performed.name, project.bodies))
    return add_overdub_layer(
        project, shape, motion.key, motion.character, motion.poses, motion.begin, holds, punch
    )


def _is_moving(poses: Sequence[Pose]) -> bool:
    first_pose = poses[0]
    return any(
        max(
            np.abs(pose.positions - first_pose.positions).max(), np.abs(pose.linear - first_pose.linear).max()
        )
        > _MIN_MOTION
        for pose in poses
    )


def _add_bone_layers(project: Project, shape: RiggedCharacter, motion: PerformedCharacter) -> Project | None:
    """Adds a layer to those bones of a shape that moved. Returns None if the performed character has another
    skeleton.
    """
    performed, replaces = motion.performed, motion.replaces
    if len(shape.skeleton) != len(motion.poses[0].positions):
        return None
    used_poses, seconds, grid = even_times(motion.character, motion.poses, motion.begin)
    linear = interpolate_linearly(np.array([pose.linear for pose in used_poses], np.float64), seconds, grid)
    root = interpolate_linearly(
        np.array([pose.positions[0] for pose in used_poses], np.float64), seconds, grid
    )
    local_turns = local_rotations(shape, from_matrix(linear))
    angles = 2 * np.arccos(np.minimum(np.abs(local_turns[:, :, 0]).min(0), 1.0))
    moved_bones = np.flatnonzero(angles > _MIN_ROTATION_RADIANS).tolist()
    travels = bool(np.ptp(root, axis=0).max() > _MIN_MOTION)
    chains = _find_moved_limbs(shape, moved_bones)
    take = Clip(
        unused(f"{performed.name} on {shape.id}", project.takes),
        shape.skeleton,
        remove_sign_jumps(compose_rotations(shape.skeleton.parents, local_turns)),
        root - root[0] + shape.skeleton.positions[0],
        float(grid[1] - grid[0]),
    )
    project = project.with_takes(take)
    punch = PunchIn.from_interval(project, float(grid[0]), float(grid[-1]))
    keeps_some = replaces and punch.moves_outside(project, shape.layers)
    for chain in chains:
        if replaces:
            project = punch_bones(project, shape.id, chain, punch)
        layer = unused(f"{take.id}: {shape.skeleton.names[chain[-1]]}", project.layer_names)
        layer_settings = {"basis": IDENTITY, "layer_id": layer, "offset": float(grid[0])}
        playback = punch.playback_settings if keeps_some else {}
        project = bind_chain(project, shape.id, chain, take.id, chain, **layer_settings, **playback)
    if travels and chains and ((replaces and not keeps_some) or shape.travel is None):
        last = project.shape(shape.id).layers[-len(chains)].id
        project = set_travel(project, shape.id, last, scale=1.0)
    return project


def _find_moved_limbs(shape: RiggedCharacter, moved: Sequence[int]) -> list[tuple[int, ...]]:
    """Returns the chains of the bones that moved. A chain continues while exactly one child bone moved."""
    chains, child_bones = list[tuple[int, ...]](), shape.skeleton.children
    for joint in moved:
        ending_chains = [
            n
            for n, chain in enumerate(chains)
            if chain[-1] == make_single_bone_chain(shape, joint)[0] and chain != (0,)
        ]
        if joint and ending_chains and len(set(child_bones[chains[ending_chains[0]][-1]]) & set(moved)) == 1:
            chains[ending_chains[0]] = (*chains[ending_chains[0]], joint)
        else:
            chains.append(make_single_bone_chain(shape, joint))
    return chains


def _add_puppet_layer(
    project: Project, puppet: ExampleCharacter, motion: PerformedCharacter
) -> Project | None:
    """Adds a layer to a puppet, with the take of the performer who moved it last. Returns None if performers
    were attached to its surface.
    """
    performed, merged = motion.performed, motion.merged
    if motion.character.kind != puppet.kind:
        return None
    holders = [event.body for event in performed.events if event.character == puppet.id and event.body >= 0]
    performer = merged.people.get(holders[-1]) if holders else None
    frames = merged.frames if performer is None else merged.select_person_frames(performer)
    clips = clips_of_frames(frames, f"{performed.name} in {puppet.id}", _UNSPLIT_TAKE_SETTINGS)
    if not clips:
        return project
    take = replace(clips[0], id=unused(clips[0].id, project.takes))
    first = next(frame.time_ns for frame in frames if frame.bodies)
    layer = PuppetLayer(take.id, offset=(first - motion.begin) * 1e-9)
    layers: tuple[PuppetLayer, ...] = (*puppet.layers, layer)
    if motion.replaces:
        punch = PunchIn.from_interval(project, layer.offset, layer.end(take.duration))
        remaining = [
            silenced for old_layer in puppet.layers if (silenced := punch(project, old_layer)) is not None
        ]
        playback = punch.playback_settings if punch.moves_outside(project, puppet.layers) else {}
        layers = (*remaining, replace(layer, **playback))
    return project.with_takes(take).with_characters(puppet.with_changes(layers=layers))


def _add_character(project: Project, motion: PerformedCharacter) -> tuple[Project, str]:
    """Adds a performed character to a project. A possessed character with the same id is replaced."""
    key, performed, begin = motion.key, motion.performed, motion.begin
    character, poses = motion.character, motion.poses
    existing = project.characters.get(key[0])
    if character.kind == "bones":
        renamed = replace(character, id=unused(key[0], project.characters))
        rest_shape, clip, offset = shape_and_clip_from_poses(renamed, poses, begin)
        take = replace(clip, id=unused(f"{performed.name} on {renamed.id}", project.takes))
        project, shape = play_clip(project, rest_shape, take)
        return project.with_characters(shape.delay_motion(offset)), shape.id
    holds = holds_from_frames(performed.frames, performed.events, unused(performed.name, project.bodies))
    other_characters = (
        project.drop_character(key[0]) if existing is not None and existing.is_possessable else project
    )
    other_characters = add_character_motion(other_characters, key, character, poses, begin, [], holds)
    name = list(other_characters.characters)[-1]
    order = {
        character_id: other_characters.characters[character_id]
        for character_id in project.characters
        if character_id in other_characters.characters
    }
    return replace(other_characters, characters={**order, **other_characters.characters}), name


RECORDERS: dict[str, Callable[[Project, Any, PerformedCharacter], Project | None]] = {
    RiggedCharacter.kind: _add_bone_layers,
    GraphCharacter.kind: _add_node_motion,
    ExampleCharacter.kind: _add_puppet_layer,
}
"""For each kind of rig, the function that adds a performance to a character of the project. The function
returns None if the performance does not match the character. Then the performed character is added as a new
character. Further kinds of rig must be registered here."""
