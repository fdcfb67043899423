"""Converts between seconds of a project and seconds of the take that a puppet's layer plays."""

from __future__ import annotations

import math

from enliven.document import Project, Puppet, PuppetLayer


def seconds_at(project: Project, layer: PuppetLayer, time: float) -> float:
    """The second of its take that a layer plays at a time of the project; its begin or end outside of it."""
    length = project.takes[layer.take].duration
    played = (time - layer.offset) * layer.speed + (length if layer.speed < 0 else 0.0)
    if layer.loop and length > 0.0:
        played -= math.floor(played / length) * length
    return min(max(played, 0.0), length)


def time_of(project: Project, layer: PuppetLayer, seconds: float) -> float:
    """The time of the project at which a layer first plays a second of its take."""
    length = project.takes[layer.take].duration
    return layer.offset + (seconds - (length if layer.speed < 0 else 0.0)) / layer.speed


def layer_end(project: Project, layer: PuppetLayer) -> float:
    """The time of the project at which a layer's take has been played once."""
    return layer.offset + project.takes[layer.take].duration / abs(layer.speed)


def layer_of(puppet: Puppet, chosen: int | None, take: str = "") -> int | None:
    """The number of the chosen layer, or of the first unmuted one; with ``take`` of those of the take."""
    wanted = [k for k, layer in enumerate(puppet.layers) if take in ("", layer.take)]
    if chosen in wanted:
        return chosen
    return next((k for k in wanted if not puppet.layers[k].muted), next(iter(wanted), None))
