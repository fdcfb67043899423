"""A character that is in the project and on an edge's stage is shown once, with what both say of it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Character, GraphShape, Project, RigBase, Shape
from enliven.matching import Board
from enliven.takes import LiveLayer, LiveOver, plays
from enliven_viewer.render import Scene, SceneCharacter
from enliven_viewer.studio.editor import Editor

_Key = tuple[Project, frozenset[int]]


@dataclass(frozen=True)
class Telling:
    """What decides which of the two is shown.

    Attributes:
        performs: whether the workspace is one of performing; elsewhere the project's is what is edited.
        heard: whether what is done live counts: not while the project plays and nothing is recorded.
        replaces: whether a recording is to take the place of what the held bones play.
        held: the ids of the characters that performers hold.
    """

    performs: bool = True
    heard: bool = True
    replaces: bool = False
    held: Collection[str] = ()


@dataclass
class Twins:
    """Makes one scene of what is live and of what the project plays.

    Attributes:
        hidden: characters of the project that gave way to the live one last.
    """

    editor: Editor
    hidden: frozenset[str] = frozenset()
    _layers: dict[str, tuple[_Key, LiveLayer]] = field(default_factory=dict)
    _overs: dict[str, tuple[Project, Character, LiveOver]] = field(default_factory=dict)

    def shown(self, scene: Scene, told: Telling) -> Scene:
        """Returns the scene without twins: a rigged one plays in its place on the stage, with what is done on
        top.
        """
        own, actors, boards, hidden = self.editor.project.characters, [], dict(scene.boards), set[str]()
        for actor in scene.actors:
            name = actor.character.id
            one = own.get(name)
            if one is None:
                actors.append(actor)
            elif not told.performs:
                boards.pop(name, None)
            elif isinstance(one, Shape) and len(one.skeleton) == len(actor.pose.positions):
                moved, joints = self._layered(one, actor, told)
                actors.append(moved)
                hidden.add(name)
                if name in boards:
                    boards[name] = _carried(boards[name], one, actor, joints)
            elif isinstance(one, GraphShape) and self._over(one, actor, told):
                actors.append(self._performed_over(one, actor))
                hidden.add(name)
            elif _alone(one, actor, told, playing=self.editor.playing):
                actors.append(actor)
                hidden.add(name)
        self.hidden = frozenset(hidden)
        self._layers = {name: kept for name, kept in self._layers.items() if name in hidden}
        self._overs = {name: kept for name, kept in self._overs.items() if name in hidden}
        return replace(scene, actors=tuple(actors), boards=boards)

    def _layered(self, shape: Shape, actor: SceneCharacter, told: Telling) -> tuple[SceneCharacter, Float]:
        """Returns a rigged character as it plays, with what is done live on top, and its joints."""
        replaced = frozenset[int]()
        if told.replaces and told.heard and actor.cues is not None:
            replaced = frozenset(actor.cues.nodes[actor.cues.firm].tolist())
        key, known = (self.editor.project, replaced), self._layers.get(shape.id)
        if known is None or known[0][0] is not key[0] or known[0][1] != replaced:
            known = self._layers[shape.id] = key, LiveLayer(self.editor.project, shape.id, replaced)
        pose, joints = known[1].pose(actor.pose, self.editor.time, heard=told.heard)
        return replace(actor, pose=pose), joints

    def _over(self, one: GraphShape, actor: SceneCharacter, told: Telling) -> bool:
        """Returns True if what is done with a possessed mesh comes on top of what it plays."""
        performed = one.id in told.held and told.heard and not told.replaces
        return performed and _same(one, actor) and plays(self.editor.project, one)

    def _performed_over(self, one: GraphShape, actor: SceneCharacter) -> SceneCharacter:
        """Returns a possessed mesh as it plays, with what is done live on top."""
        known = self._overs.get(one.id)
        if known is None or known[0] is not self.editor.project or known[1] is not actor.character:
            made = LiveOver(self.editor.project, one.id, actor.character)
            known = self._overs[one.id] = self.editor.project, actor.character, made
        posed = self.editor.posed(one.id)
        pose, drawn = known[2].pose(actor.pose, posed.pose), posed.drawn
        assert drawn is not None
        # Cues name nodes of the mesh on the stage, which are others.
        return replace(actor, character=drawn, pose=pose, cues=None)


def _same(one: RigBase, actor: SceneCharacter) -> bool:
    """Returns True if the stage has the surface that the project has."""
    return one.mesh is not None and len(one.mesh.vertices) == len(actor.character.vertices)


def _alone(one: RigBase, actor: SceneCharacter, told: Telling, *, playing: bool) -> bool:
    """Returns True if the live one is shown, and not the project's: it is held, or nothing plays."""
    return told.heard and (not playing or (_same(one, actor) and one.id in told.held))


def _carried(board: Board, shape: Shape, actor: SceneCharacter, joints: Float) -> Board:
    """Returns the matches of a character with their lines on its joints (N, 3) as they are shown."""
    pose = actor.pose
    live = pose.positions + np.einsum("nij,nj->ni", pose.linear, shape.skeleton.vectors)

    def on(line: Float) -> Float:
        return joints[np.linalg.norm(line[:, None] - live[None], axis=2).argmin(1)] if len(line) else line

    rows = tuple(replace(row, lines=tuple(on(line) for line in row.lines)) for row in board.rows)
    return replace(board, rows=rows)
