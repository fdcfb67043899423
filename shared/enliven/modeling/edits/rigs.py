"""What every rig can do, written down; and the table of rigs."""

from __future__ import annotations

from typing import Any, Protocol

from enliven.arrays import Float
from enliven.document import AnyRig, Character, GraphShape, Pose, Project, Puppet, Shape
from enliven.modeling.mesh import CutSurface, SeamSettings
from enliven.modeling.possessed import GraphRig
from enliven.modeling.puppet import PuppetRig
from enliven.modeling.rigged import Axes, ShapeRig


class RigEdits(Protocol):
    """The part of each edit that a rig does its own way. A character is a value: these return another one.

    With ``centre`` c, all of them commute with time: at every time the vertices of ``moved`` are at
    turn (x - about) + about + offset, those of ``scaled`` at c + factor (x - c), and those of ``mirrored``
    at c + M (x - c), with x where the vertices were.
    """

    def centre(self, character: Any, /) -> Float:
        """(3,) metres in the world: what it is turned, scaled and mirrored about."""

    def rest(self, character: Any, /) -> Float:
        """(V, 3) metres: its vertices at rest; of a skeleton without a mesh, its joints."""

    def seen(self, project: Project, character: Any, time: float, /) -> Float:
        """(V, 3) metres: its vertices at a time of the project; of a skeleton without a mesh, its joints."""

    def drawn(self, character: Any, /) -> Character:
        """Its mesh and pivots, as viewers and the wire know it."""

    def pose(self, project: Project, character: Any, time: float, /) -> Pose:
        """The transforms of those pivots at a time of the project."""

    def moved(self, character: Any, offset: Float, turn: Float, about: Float, /) -> Any:
        """Moved as one rigid piece."""

    def scaled(self, character: Any, factor: float, /) -> Any:
        """Larger or smaller."""

    def mirrored(self, project: Project, character: Any, axes: Axes, /) -> Any:
        """Reflected by ``axes``; left and right of its motion are exchanged with it."""

    def cut(
        self, project: Project, character_id: str, stroke: CutSurface, time: float, notes: list[str], /
    ) -> tuple[Project, tuple[str, ...]]:
        """Cut along a stroke, as it is seen at a time; the first of the parts keeps the id."""

    def merged(
        self,
        project: Project,
        host_id: str,
        graft_id: str,
        time: float,
        node: int | str | None,
        at: float,
        loose: bool,
        seam: SeamSettings,
        notes: list[str],
        /,
    ) -> Project:
        """Two of this rig as one, put together where they are at a time."""


RIGS: dict[str, RigEdits] = {
    Shape.kind: ShapeRig(),
    GraphShape.kind: GraphRig(),
    Puppet.kind: PuppetRig(),
}
"""The edits of every kind of rig."""


def rig_of(character: AnyRig) -> RigEdits:
    """The edits of a character's rig."""
    return RIGS[character.kind]


def vertices_of(project: Project, character_id: str, time: float) -> Float:
    """(V, 3) metres: where the vertices of a character are at a time of the project.

    Raises:
        InputError: where there is none, or it lacks something to move.
    """
    character = project.characters[project.character(character_id).id]
    return rig_of(character).seen(project, character, time)


def pose_of_character(project: Project, character_id: str, time: float) -> Pose:
    """The transforms of a character for the wire and the viewer, as :func:`vertices_of`."""
    character = project.characters[project.character(character_id).id]
    return rig_of(character).pose(project, character, time)
