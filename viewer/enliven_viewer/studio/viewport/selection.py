"""The selection of an artist: a shape, a mesh or a puppet, and parts of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from enliven.document import Project


@dataclass(frozen=True)
class Selection:
    """The objects that the next command applies to.

    Attributes:
        shape: its id, or None.
        joint: a joint of it, or None.
        chain: joints of it from one end to the other; empty without a chain.
        layer: the character and the number of a layer of it, or None.
        graph: the id of a possessed mesh, or None; then no shape is chosen.
        puppet: the id of a puppet, or None; then neither a shape nor a possessed mesh is chosen.
        point: the number of a control point of it, or None.
        puppet_layer: the number of a layer of it, or None.
    """

    shape: str | None = None
    joint: int | None = None
    chain: tuple[int, ...] = ()
    layer: tuple[str, int] | None = None
    graph: str | None = None
    puppet: str | None = None
    point: int | None = None
    puppet_layer: int | None = None

    @property
    def character(self) -> str | None:
        """The id of what is chosen, whatever rig it has."""
        return self.shape or self.graph or self.puppet


def valid_selection(chosen: Selection, project: Project) -> Selection:
    """The selection without the objects that the project no longer has."""
    if chosen.layer is not None:
        owner = project.characters.get(chosen.layer[0])
        if owner is None or chosen.layer[1] >= len(owner.playing):
            chosen = replace(chosen, layer=None)
    if chosen.graph is not None and chosen.graph not in project.graphs:
        chosen = replace(chosen, graph=None)
    if chosen.puppet is not None:
        chosen = _valid_puppet(chosen, project)
    if chosen.shape is not None and chosen.shape not in project.shapes:
        chosen = Selection(layer=chosen.layer)
    count = len(project.shapes[chosen.shape].skeleton) if chosen.shape else 0
    if chosen.joint is not None and chosen.joint >= count:
        chosen = replace(chosen, joint=None)
    if any(joint >= count for joint in chosen.chain):
        chosen = replace(chosen, chain=())
    return chosen


def _valid_puppet(chosen: Selection, project: Project) -> Selection:
    """The selection without a puppet, a control point or a layer that is no longer there."""
    puppet = project.puppets.get(str(chosen.puppet))
    if puppet is None:
        return Selection()
    point = chosen.point if (chosen.point or 0) < len(puppet.points) else None
    layer = chosen.puppet_layer if (chosen.puppet_layer or 0) < len(puppet.layers) else None
    return replace(chosen, point=point, puppet_layer=layer)
