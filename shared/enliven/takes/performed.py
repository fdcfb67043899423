"""Converts a performance, recorded or live, into takes and layers of a project.

    project, names = add_performance(project, performed, begin)     # begin: the sensor's clock at 0 seconds

Each performer becomes a take. A character of the project that was performed plays the new motion. A rigged
shape gets layers on the bones that moved. A possessed mesh gets motion of its nodes that can be solved again.
A puppet gets a layer of its performer's take. The new motion plays on top of the present motion, or replaces
it for the length of the recording (punch-in). Other characters are added to the project.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from enliven.document import (
    Character,
    Clip,
    GraphShape,
    Pose,
    Project,
    Puppet,
    PuppetLayer,
    RigBase,
    Shape,
    unused,
)
from enliven.formats.rig import play_clip
from enliven.frames import BodyFrame
from enliven.modeling.edits import group_as_take
from enliven.modeling.possessed import between, even_times
from enliven.motion.layers import bind_chain, set_travel
from enliven.rotation import IDENTITY, from_matrix, remove_sign_jumps
from enliven.takes.body_takes import holds_from_frames
from enliven.takes.live_layer import compose_rotations, local_rotations, single_bone_chain
from enliven.takes.overdub import add_overdub_layer, has_motion
from enliven.takes.performers import MergedPerformers, merge_performers
from enliven.takes.possessed import add_character_motion
from enliven.takes.punch_in import PunchIn, punch_bones
from enliven.takes.recorded import TakeSettings, clips_of_frames
from enliven.takes.rigged import shape_and_clip_from_poses
from enliven.wire import HoldMessage

_MIN_POSES = 2
"""Minimum number of poses of a character that counts as performed."""
_MIN_EXAMPLES = 2
"""Minimum number of examples of an example-driven character. With fewer, the performer possesses its mesh."""
_MIN_MOTION = 0.005
"""Minimum motion that counts as moving, in metres or in entries of a rotation matrix. The quantization steps
of transmitted poses are a tenth of this."""
_MIN_ROTATION_RADIANS = 0.01
"""Minimum rotation of a bone, radians (half a degree). Transmitted rotations have finer steps."""

Key = tuple[str, int]
"""The id and the revision of a character."""


_UNSPLIT_TAKE_SETTINGS = TakeSettings(gap=math.inf)
"""Creates one take per performer, even if the tracker lost them for a while."""
ONLOOKER_SUFFIX = " onlooker"
"""Suffix of a take's name, before its number, if its performer held no character while other performers
did."""


@dataclass
class PerformedMotion:
    """The motion of performers and characters over a period.

    Attributes:
        name: of the takes that are created from it.
        since_ns: the sensor's clock at which it starts; frames and holds may begin before.
        frames: of tracked performers, in the order of time.
        events: when performers attached to and released characters, in the order of time.
        characters: by id and revision.
        poses: the poses of each character, ordered by time.
    """

    name: str
    since_ns: int = 0
    frames: list[BodyFrame] = field(default_factory=list)
    events: list[HoldMessage] = field(default_factory=list)
    characters: dict[Key, Character] = field(default_factory=dict)
    poses: dict[Key, list[Pose]] = field(default_factory=dict)

    def until(self, time_ns: int) -> PerformedMotion:
        """Returns the part of the performance up to a time of the sensor's clock."""
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
    def moved(self) -> list[Key]:
        """The characters that moved."""
        return [key for key, poses in self.poses.items() if len(poses) >= _MIN_POSES and _is_moving(poses)]


def add_performance(
    project: Project, performed: PerformedMotion, begin: int, *, replaces: bool = False, beside: str = ""
) -> tuple[Project, tuple[str, ...]]:
    """Returns a project with takes and layers of the performance, and the ids of the new content.

    The layers are one of several alternatives (:mod:`enliven.modeling.edits.take_comping`), or the first of
    new ones.

    Args:
        begin: nanoseconds, the sensor's clock at 0 seconds of the project.
        replaces: True if the recording replaces the earlier motion of the moved characters between its begin
            and end. If False, both play.
        beside: name of the group of alternative takes to which the recording is added. Empty creates a new
            group.

    Raises:
        InputError: if the poses of a character are inconsistent.
    """
    new_ids, before = list[str](), project
    own_frames = [frame for frame in performed.frames if frame.time_ns >= performed.since_ns]
    merged = merge_performers(own_frames, performed.events)
    for clip in _performer_clips(merged, performed):
        project = project.with_takes(replace(clip, id=unused(clip.id, project.takes)))
        new_ids.append(list(project.takes)[-1])
    for key in performed.moved:
        existing, poses = project.characters.get(key[0]), performed.poses[key]
        character = performed.characters[key]
        if isinstance(existing, Shape) and len(existing.skeleton) == len(poses[0].positions):
            project = _add_motion_layer(project, existing, key, performed, begin, replaces=replaces)
            new_ids.append(existing.id)
        elif isinstance(existing, Puppet) and character.kind == "points":
            project = _add_puppet_layer(project, existing, performed, merged, begin, replaces=replaces)
            new_ids.append(existing.id)
        elif isinstance(existing, GraphShape) and _keeps_earlier_motion(
            project, existing, performed, key, begin, replaces=replaces
        ):
            holds = holds_from_frames(
                performed.frames, performed.events, unused(performed.name, project.bodies)
            )
            punch = _motion_span(project, performed, key, begin) if replaces else None
            project = add_overdub_layer(project, existing, key, character, poses, begin, holds, punch)
            new_ids.append(existing.id)
        else:
            project, name = _add_character(project, key, performed, begin)
            new_ids.append(name)
    return group_as_take(before, project, performed.name, beside or performed.name), tuple(
        dict.fromkeys(new_ids)
    )


def _performer_clips(merged: MergedPerformers, performed: PerformedMotion) -> list[Clip]:
    """Returns one clip for each performer. Performers that held no character while others did are
    onlookers."""
    ids = {
        performer for event in performed.events for performer in (event.body, event.former, *event.holders)
    }
    holding = {merged.people[performer] for performer in ids if performer in merged.people}
    actors = [performer for performer in merged.person_ids if performer in holding or not holding]
    others = [performer for performer in merged.person_ids if performer not in actors]
    clips_by_person = {
        performer: clips_of_frames(merged.alone(performer), performed.name, _UNSPLIT_TAKE_SETTINGS)[:1]
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


def _motion_span(project: Project, performed: PerformedMotion, key: Key, begin: int) -> PunchIn:
    """Returns the time span of a character's motion, in seconds of the project."""
    poses = performed.poses[key]
    first, last = (1e-9 * (pose.time_ns - begin) for pose in (poses[0], poses[-1]))
    return PunchIn.of(project, first, last)


def _keeps_earlier_motion(
    project: Project, shape: GraphShape, performed: PerformedMotion, key: Key, begin: int, *, replaces: bool
) -> bool:
    """Returns True if a possessed mesh continues to play some of its earlier motion."""
    if not has_motion(project, shape):
        return False
    punch = _motion_span(project, performed, key, begin)
    # Muted alternatives may be enabled again, so they must be kept.
    has_muted = any(layer.muted for layer in shape.playing)
    return not replaces or has_muted or punch.leaves(project, shape.playing)


def _is_moving(poses: Sequence[Pose]) -> bool:
    first = poses[0]
    return any(
        max(np.abs(pose.positions - first.positions).max(), np.abs(pose.linear - first.linear).max())
        > _MIN_MOTION
        for pose in poses
    )


def _add_motion_layer(
    project: Project, shape: Shape, key: Key, performed: PerformedMotion, begin: int, *, replaces: bool
) -> Project:
    """Returns a project in which the moved bones of a shape have an additional layer."""
    used_poses, seconds, grid = even_times(performed.characters[key], performed.poses[key], begin)
    linear = between(np.array([pose.linear for pose in used_poses], np.float64), seconds, grid)
    root = between(np.array([pose.positions[0] for pose in used_poses], np.float64), seconds, grid)
    local_turns = local_rotations(shape, from_matrix(linear))
    angles = 2 * np.arccos(np.minimum(np.abs(local_turns[:, :, 0]).min(0), 1.0))
    moved = np.flatnonzero(angles > _MIN_ROTATION_RADIANS).tolist()
    travels = bool(np.ptp(root, axis=0).max() > _MIN_MOTION)
    chains = _moved_limbs(shape, moved)
    take = Clip(
        unused(f"{performed.name} on {shape.id}", project.takes),
        shape.skeleton,
        remove_sign_jumps(compose_rotations(shape.skeleton.parents, local_turns)),
        root - root[0] + shape.skeleton.positions[0],
        float(grid[1] - grid[0]),
    )
    project = project.with_takes(take)
    punch = PunchIn.of(project, float(grid[0]), float(grid[-1]))
    keeps_some = replaces and punch.leaves(project, shape.layers)
    for chain in chains:
        if replaces:
            project = punch_bones(project, shape.id, chain, punch)
        layer = unused(f"{take.id}: {shape.skeleton.names[chain[-1]]}", project.layer_names)
        layer_settings = {"basis": IDENTITY, "layer_id": layer, "offset": float(grid[0])}
        played = punch.played if keeps_some else {}
        project = bind_chain(project, shape.id, chain, take.id, chain, **layer_settings, **played)
    if travels and chains and ((replaces and not keeps_some) or shape.travel is None):
        last = project.shape(shape.id).layers[-len(chains)].id
        project = set_travel(project, shape.id, last, scale=1.0)
    return project


def _moved_limbs(shape: Shape, moved: Sequence[int]) -> list[tuple[int, ...]]:
    """Returns the chains of the bones that moved; a chain continues while exactly one child bone moved
    too.
    """
    chains, below = list[tuple[int, ...]](), shape.skeleton.children
    for joint in moved:
        ended = [
            n
            for n, chain in enumerate(chains)
            if chain[-1] == single_bone_chain(shape, joint)[0] and chain != (0,)
        ]
        if joint and ended and len(set(below[chains[ended[0]][-1]]) & set(moved)) == 1:
            chains[ended[0]] = (*chains[ended[0]], joint)
        else:
            chains.append(single_bone_chain(shape, joint))
    return chains


def _add_puppet_layer(
    project: Project,
    puppet: Puppet,
    performed: PerformedMotion,
    merged: MergedPerformers,
    begin: int,
    *,
    replaces: bool,
) -> Project:
    """Returns a project in which a puppet plays the take of the performer that held it last."""
    holders = [event.body for event in performed.events if event.character == puppet.id and event.body >= 0]
    performer = merged.people.get(holders[-1]) if holders else None
    frames = merged.frames if performer is None else merged.alone(performer)
    clips = clips_of_frames(frames, f"{performed.name} in {puppet.id}", _UNSPLIT_TAKE_SETTINGS)
    if not clips:
        return project
    take = replace(clips[0], id=unused(clips[0].id, project.takes))
    first = next(frame.time_ns for frame in frames if frame.bodies)
    layer = PuppetLayer(take.id, offset=(first - begin) * 1e-9)
    layers: tuple[PuppetLayer, ...] = (*puppet.layers, layer)
    if replaces:
        punch = PunchIn.of(project, layer.offset, layer.end(take.duration))
        remaining = [
            silenced for old_layer in puppet.layers if (silenced := punch(project, old_layer)) is not None
        ]
        played = punch.played if punch.leaves(project, puppet.layers) else {}
        layers = (*remaining, replace(layer, **played))
    return project.with_takes(take).with_characters(puppet.with_changes(layers=layers))


def _is_bare(character: RigBase | None) -> bool:
    """Returns True if a character is a mesh without motion. On a stage, performers can possess such a
    mesh."""
    return (
        isinstance(character, Puppet) and character.mesh is not None and len(character.poses) < _MIN_EXAMPLES
    )


def _add_character(project: Project, key: Key, performed: PerformedMotion, begin: int) -> tuple[Project, str]:
    """Returns a project with a performed character added. A possessed character with the same id is
    replaced.
    """
    character, poses = performed.characters[key], performed.poses[key]
    existing = project.characters.get(key[0])
    if character.kind == "bones":
        renamed = replace(character, id=unused(key[0], project.characters))
        still, clip, offset = shape_and_clip_from_poses(renamed, poses, begin)
        take = replace(clip, id=unused(f"{performed.name} on {renamed.id}", project.takes))
        project, shape = play_clip(project, still, take)
        return project.with_characters(shape.later(offset)), shape.id
    is_replaced = isinstance(existing, GraphShape) or _is_bare(existing)
    holds = holds_from_frames(performed.frames, performed.events, unused(performed.name, project.bodies))
    rest = project.without(key[0]) if is_replaced else project
    rest = add_character_motion(rest, key, character, poses, begin, [], holds)
    name = list(rest.characters)[-1]
    order = {
        character_id: rest.characters[character_id]
        for character_id in project.characters
        if character_id in rest.characters
    }
    return replace(rest, characters={**order, **rest.characters}), name
