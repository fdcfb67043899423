"""Converts a performance, recorded or live, into takes and layers of a project.

    project, names = add_performance(project, performed, begin)     # begin: the sensor's clock at 0 seconds

Each performer becomes a take. Each character that performers moved plays the new motion. A rigged shape gets
layers on the bones that moved. A possessed mesh gets the motion of its nodes, which can be solved again. A
puppet gets a layer with its performer's take. The new motion is added to the existing motion, or replaces it
during the recording (punch-in). Characters that are not in the project yet are added.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from enliven.document import (
    Clip,
    ExampleCharacter,
    GraphCharacter,
    Project,
    RiggedCharacter,
    unused,
)
from enliven.formats.rig.rig import play_clip
from enliven.modeling.edits import group_as_take
from enliven.motion_clips.merged_performers import MergedPerformers, merge_performers
from enliven.motion_clips.recorded_characters import add_character_motion, shape_and_clip_from_poses
from enliven.motion_clips.tracked_people import UNSPLIT_TAKE_SETTINGS, clips_of_frames
from enliven.overdub.performance import PerformedCharacter, PerformedMotion
from enliven.overdub.possessed_overdub import add_node_motion
from enliven.overdub.puppet_overdub import add_puppet_layer
from enliven.overdub.rigged_overdub import add_bone_layers

ONLOOKER_SUFFIX = " onlooker"
"""Suffix of a take's name, before its number, if its performer was attached to no character while other
performers were."""


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
            merged.select_person_frames(performer), performed.name, UNSPLIT_TAKE_SETTINGS
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
    other_characters = (
        project.drop_character(key[0]) if existing is not None and existing.is_possessable else project
    )
    other_characters = add_character_motion(
        other_characters, key, character, poses, begin, [], motion.holds(project)
    )
    name = list(other_characters.characters)[-1]
    order = {
        character_id: other_characters.characters[character_id]
        for character_id in project.characters
        if character_id in other_characters.characters
    }
    return replace(other_characters, characters={**order, **other_characters.characters}), name


RECORDERS: dict[str, Callable[[Project, Any, PerformedCharacter], Project | None]] = {
    RiggedCharacter.kind: add_bone_layers,
    GraphCharacter.kind: add_node_motion,
    ExampleCharacter.kind: add_puppet_layer,
}
"""For each kind of rig, the function that adds a performance to a character of the project. The function
returns None if the performance does not match the character. Then the performed character is added as a new
character. Further kinds of rig must be registered here."""
