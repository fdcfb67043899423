"""Dragging a whole character by its surface: moved, turned in place, or merged with another by Shift."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Project
from enliven.modeling.edits import merge_characters, move_character, turn_character
from enliven.rotation import from_rotation_vector
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.puppets import puppet_at
from enliven_viewer.studio.tools.base import Pointer
from enliven_viewer.studio.viewport import possessed_at, surface_at

_TURN = 0.01
"""Radians a pixel."""
_UPRIGHT = np.array([0.0, 1.0, 0.0])


def mesh_at(editor: Editor, pointer: Pointer, without: str = "") -> tuple[str, float] | None:
    """The possessed mesh or puppet under the pointer, but for one, and metres to it."""
    lens, at, found = editor.lens, pointer.at, list[tuple[str, float]]()
    graph = possessed_at([one for one in editor.possessed if one.shape.id != without], lens, at)
    if graph is not None:
        found.append(graph)
    puppet = puppet_at([one for one in editor.puppets.standing if one.puppet.id != without], lens, at)
    if puppet is not None:
        found.append((puppet[0].puppet.id, puppet[2]))
    return min(found, key=lambda hit: hit[1]) if found else None


def character_at(editor: Editor, pointer: Pointer, without: str = "") -> str | None:
    """The character of any rig with its surface under the pointer, but for one."""
    mesh = mesh_at(editor, pointer, without)
    shapes = [posed for posed in editor.posed_shapes if posed.shape.id != without]
    hit = surface_at(shapes, editor.lens, pointer.at)
    if hit is not None and (mesh is None or hit.depth < mesh[1]):
        return hit.shape
    return None if mesh is None else mesh[0]


class CharacterDrag:
    """A possessed mesh or a puppet that is dragged by a place on its surface."""

    def __init__(self, editor: Editor, character: str, at: Float, start: Pointer) -> None:
        self.editor, self.character, self._at, self._start = editor, character, at, start

    @classmethod
    def of(cls, editor: Editor, pointer: Pointer) -> CharacterDrag | None:
        """The drag of the possessed mesh or puppet under the pointer; None where none is."""
        hit = mesh_at(editor, pointer)
        if hit is None:
            return None
        editor.choose(hit[0])
        editor.playing = False
        return cls(editor, hit[0], editor.lens.view.eye + hit[1] * editor.lens.ray(pointer.at), pointer)

    def moved(self, project: Project, pointer: Pointer) -> Project:
        """The project with the character as far as the pointer went."""
        lens = self.editor.lens
        return move_character(project, self.character, lens.on_plane(pointer.at, self._at) - self._at)

    def turned(self, project: Project, pointer: Pointer) -> Project:
        """The project with it turned about the upright, by as much as the pointer went across."""
        angle = _TURN * (pointer.at[0] - self._start.at[0])
        return turn_character(project, self.character, from_rotation_vector(_UPRIGHT * angle))

    def drop(self, pointer: Pointer) -> None:
        """Let go: there, or with Shift as one with the character that is under the pointer."""
        editor, time, name = self.editor, self.editor.time, self.character
        host = character_at(editor, pointer, without=name) if pointer.shift else None
        if host is None:
            editor.edit(f"move {name}", lambda project: self.moved(project, pointer))
            return
        notes = list[str]()

        def change(project: Project) -> Project:
            return merge_characters(self.moved(project, pointer), host, name, time, notes=notes)

        if editor.edit(f"merge {name}", change):
            editor.choose(host)
            editor.toasts.say(f"{name} is now part of {host}", *notes[:1])
