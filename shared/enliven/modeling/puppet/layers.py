"""Layers of a puppet: the takes that it plays, with their time, weight and constraints."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from enliven.document import Project, Puppet, PuppetLayer
from enliven.errors import InputError
from enliven.examples import check_layer, missing
from enliven.modeling.puppet.points import check_names


def play_take(project: Project, puppet_id: str, take: str, **attributes: Any) -> Project:
    """A project in which a puppet plays a take, upon what it plays already.

    Args:
        attributes: of the ``PuppetLayer``: points, offset, speed, loop, weight, travel,
            positions, ...

    Raises:
        InputError: for a take or control point that is not there, and for constraints that contradict one
            another: it says which.
    """
    puppet = project.puppet(puppet_id)
    check_names(attributes, PuppetLayer, f"layer of {take!r}")
    layer = _checked(project, puppet, PuppetLayer(take, **attributes))
    return project.with_characters(puppet.with_changes(layers=(*puppet.layers, layer)))


def change_layer(project: Project, puppet_id: str, number: int, **changes: Any) -> Project:
    """A project with a layer of a puppet changed, as :func:`play_take` has it.

    Raises:
        InputError: where there is no layer of that number, and as :func:`play_take` does.
    """
    puppet = project.puppet(puppet_id)
    _layer(puppet, number)
    check_names(changes, PuppetLayer, f"layer {number}")
    layer = _checked(project, puppet, replace(puppet.layers[number], **changes))
    layers = (*puppet.layers[:number], layer, *puppet.layers[number + 1 :])
    return project.with_characters(puppet.with_changes(layers=layers))


def remove_layer(project: Project, puppet_id: str, number: int) -> Project:
    """A project in which a puppet no longer plays a layer; the take stays.

    Raises:
        InputError: where there is no layer of that number.
    """
    puppet = project.puppet(puppet_id)
    _layer(puppet, number)
    layers = puppet.layers[:number] + puppet.layers[number + 1 :]
    return project.with_characters(puppet.with_changes(layers=layers))


def _layer(puppet: Puppet, number: int) -> PuppetLayer:
    if not 0 <= number < len(puppet.layers):
        mend = f"It has {len(puppet.layers)}."
        raise InputError(f"there is no layer {number}", where=f"puppet {puppet.id!r}", mend=mend)
    return puppet.layers[number]


def _checked(project: Project, puppet: Puppet, layer: PuppetLayer) -> PuppetLayer:
    """The layer, checked as far as an unfinished puppet allows."""
    where = f"puppet {puppet.id!r}"
    if layer.take not in project.takes:
        mend = f"Known: {', '.join(project.takes)}." if project.takes else "Import one first."
        raise InputError(f"there is no take {layer.take!r}", where=where, mend=mend)
    for name in layer.points:
        puppet.index(name)
    if not missing(project, puppet):
        check_layer(project, puppet, layer)
    return layer
