"""Layers of a puppet: the takes that it plays, with their time, weight and constraints."""

from __future__ import annotations

from typing import Any

from enliven.document import Project, Puppet, PuppetLayer
from enliven.errors import InputError
from enliven.examples import check_layer, missing
from enliven.modeling.rig import check_names


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
    layer = checked_layer(project, puppet, PuppetLayer(take, **attributes))
    return project.with_characters(puppet.with_changes(layers=(*puppet.layers, layer)))


def checked_layer(project: Project, puppet: Puppet, layer: PuppetLayer) -> PuppetLayer:
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
