"""Overdub of a puppet: adds a layer with the take of its performer."""

from __future__ import annotations

from dataclasses import replace

from enliven.document import ExampleCharacter, Project, PuppetLayer, unused
from enliven.motion_clips.tracked_people import UNSPLIT_TAKE_SETTINGS, clips_of_frames
from enliven.overdub.performance import PerformedCharacter
from enliven.overdub.punch_in import PunchIn


def add_puppet_layer(
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
    clips = clips_of_frames(frames, f"{performed.name} in {puppet.id}", UNSPLIT_TAKE_SETTINGS)
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
        played = punch.playback_settings if punch.moves_outside(project, puppet.layers) else {}
        layers = (*remaining, replace(layer, **played))
    return project.with_takes(take).with_characters(puppet.with_changes(layers=layers))
