"""The duration of a project."""

from __future__ import annotations

from enliven.document import Project, closing_time


def measure_project_length(project: Project, shortest: float) -> float:
    """Returns the duration in seconds in which each layer and sound plays once, but at least ``shortest``.
    With looping layers it is slightly longer, so that all loops restart together.
    """
    layers = [layer for character in project.characters.values() for layer in character.playing]
    sounds = [sound.end for sound in project.sounds.values()]
    least = max([shortest, *(layer.end(project.length_of(layer)) for layer in layers), *sounds])
    return closing_time([layer.lasting(project.length_of(layer)) for layer in layers if layer.loop], least)
