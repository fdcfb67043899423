"""Merges a character that is both in the project and on an edge's stage, so that it is shown only once (live
overlay).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Character, GraphCharacter, Project, RigBase, RiggedCharacter
from enliven.matching.match_list import MatchList
from enliven.overdub.possessed_overdub import LiveOverdub, has_motion
from enliven.overdub.rigged_overdub import LiveLayer
from enliven_viewer.render.scene import Scene, SceneCharacter
from enliven_viewer.studio.editor.editor import Editor

_Key = tuple[Project, frozenset[int]]


@dataclass(frozen=True)
class OverlayConditions:
    """The conditions that determine which version of a character is shown.

    Attributes:
        is_performing: True in a workspace for performing. The other workspaces edit the project's version.
        plays_live: True if live motion is shown. It is False while the project plays without a recording.
        replaces_motion: whether a recording will replace the motion of the attached bones.
        held_ids: ids of the characters that performers control.
    """

    is_performing: bool = True
    plays_live: bool = True
    replaces_motion: bool = False
    held_ids: Collection[str] = ()


@dataclass
class LiveOverlay:
    """Merges the live scene with the motion of the project.

    Attributes:
        hidden: characters of the project that are currently replaced by live ones.
    """

    editor: Editor
    hidden: frozenset[str] = frozenset()
    _layers: dict[str, tuple[_Key, LiveLayer]] = field(default_factory=dict)
    _performances: dict[str, tuple[Project, Character, LiveOverdub]] = field(default_factory=dict)

    def merge(self, scene: Scene, conditions: OverlayConditions) -> Scene:
        """Returns the scene without duplicates.

        A rigged character plays its own motion at its position on the stage, with live motion added.
        """
        project_characters, actors, boards, hidden = (
            self.editor.project.characters,
            [],
            dict(scene.boards),
            set[str](),
        )
        for actor in scene.actors:
            name = actor.character.id
            character = project_characters.get(name)
            if character is None:
                actors.append(actor)
            elif not conditions.is_performing:
                boards.pop(name, None)
            elif isinstance(character, RiggedCharacter) and len(character.skeleton) == len(
                actor.pose.positions
            ):
                moved, joints = self._add_live_motion(character, actor, conditions)
                actors.append(moved)
                hidden.add(name)
                if name in boards:
                    boards[name] = _move_match_lines(boards[name], character, actor, joints)
            elif isinstance(character, GraphCharacter) and self._is_overdub(character, actor, conditions):
                actors.append(self._add_performance(character, actor))
                hidden.add(name)
            elif _replaces_own(character, actor, conditions, playing=self.editor.playing):
                actors.append(actor)
                hidden.add(name)
        self.hidden = frozenset(hidden)
        self._layers = {name: layer for name, layer in self._layers.items() if name in hidden}
        self._performances = {
            name: performance for name, performance in self._performances.items() if name in hidden
        }
        return replace(scene, actors=tuple(actors), boards=boards)

    def _add_live_motion(
        self, shape: RiggedCharacter, actor: SceneCharacter, conditions: OverlayConditions
    ) -> tuple[SceneCharacter, Float]:
        """Returns a rigged character with its own motion plus the live motion, and its joints (N, 3) in
        metres.
        """
        replaced = frozenset[int]()
        if conditions.replaces_motion and conditions.plays_live and actor.cues is not None:
            replaced = frozenset(actor.cues.nodes[actor.cues.attached_mask].tolist())
        key, cached = (self.editor.project, replaced), self._layers.get(shape.id)
        if cached is None or cached[0][0] is not key[0] or cached[0][1] != replaced:
            cached = self._layers[shape.id] = key, LiveLayer(self.editor.project, shape.id, replaced)
        pose, joints = cached[1].pose(actor.pose, self.editor.time, heard=conditions.plays_live)
        return replace(actor, pose=pose), joints

    def _is_overdub(
        self, shape: GraphCharacter, actor: SceneCharacter, conditions: OverlayConditions
    ) -> bool:
        """Returns True if the live motion of a possessed mesh is added to its own."""
        performed = (
            shape.id in conditions.held_ids and conditions.plays_live and not conditions.replaces_motion
        )
        return performed and _has_same_surface(shape, actor) and has_motion(self.editor.project, shape)

    def _add_performance(self, shape: GraphCharacter, actor: SceneCharacter) -> SceneCharacter:
        """Returns a possessed mesh with its own motion plus the live motion."""
        cached = self._performances.get(shape.id)
        if cached is None or cached[0] is not self.editor.project or cached[1] is not actor.character:
            live_over = LiveOverdub(self.editor.project, shape.id, actor.character)
            cached = self._performances[shape.id] = self.editor.project, actor.character, live_over
        posed = self.editor.stage_character(shape.id)
        pose, drawn = cached[2].pose(actor.pose, posed.pose), posed.drawn
        assert drawn is not None
        # Drop the cues, because they refer to nodes of the mesh on the stage, which differ from this mesh's
        # nodes.
        return replace(actor, character=drawn, pose=pose, cues=None)


def _has_same_surface(character: RigBase, actor: SceneCharacter) -> bool:
    """Returns True if the stage has the same surface as the project."""
    return character.mesh is not None and len(character.mesh.vertices) == len(actor.character.vertices)


def _replaces_own(
    character: RigBase, actor: SceneCharacter, conditions: OverlayConditions, *, playing: bool
) -> bool:
    """Returns True if the live version replaces the project's, because it is being controlled or the project
    does not play.
    """
    return conditions.plays_live and (
        not playing or (_has_same_surface(character, actor) and character.id in conditions.held_ids)
    )


def _move_match_lines(
    board: MatchList, shape: RiggedCharacter, actor: SceneCharacter, joints: Float
) -> MatchList:
    """Returns a character's matches with their lines moved to its shown joints (N, 3)."""
    pose = actor.pose
    live = pose.positions + np.einsum("nij,nj->ni", pose.linear, shape.skeleton.vectors)

    def on(line: Float) -> Float:
        return joints[np.linalg.norm(line[:, None] - live[None], axis=2).argmin(1)] if len(line) else line

    rows = tuple(replace(row, lines=tuple(on(line) for line in row.lines)) for row in board.rows)
    return replace(board, rows=rows)
