"""Dragging a puppet: it is moved, turned in place, or dropped on another with Shift to merge with it."""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import Project
from enliven.modeling.puppet import merge_puppets, move_puppet, turn_puppet
from enliven.rotation import from_rotation_vector
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.puppets import puppet_at
from enliven_viewer.studio.tools.base import Pointer

_TURN = 0.01
"""Radians a pixel."""
_UPRIGHT = np.array([0.0, 1.0, 0.0])


class PuppetDrag:
    """A puppet that is dragged by a place on its surface."""

    def __init__(self, editor: Editor, puppet: str, at: Float, start: Pointer) -> None:
        self.editor, self.puppet, self._at, self._start = editor, puppet, at, start

    @classmethod
    def of(cls, editor: Editor, pointer: Pointer) -> PuppetDrag | None:
        """The drag of the puppet under the pointer; None where no puppet is."""
        hit = puppet_at(editor.puppets.standing, editor.lens, pointer.at)
        if hit is None:
            return None
        editor.puppets.choose(hit[0].puppet.id)
        editor.playing = False
        place = editor.lens.view.eye + hit[2] * editor.lens.ray(pointer.at)
        return cls(editor, hit[0].puppet.id, place, pointer)

    def moved(self, project: Project, pointer: Pointer) -> Project:
        """The project with the puppet as far as the pointer went."""
        lens = self.editor.lens
        return move_puppet(project, self.puppet, lens.on_plane(pointer.at, self._at) - self._at)

    def turned(self, project: Project, pointer: Pointer) -> Project:
        """The project with the puppet turned about the upright, by as much as the pointer went across."""
        angle = _TURN * (pointer.at[0] - self._start.at[0])
        return turn_puppet(project, self.puppet, from_rotation_vector(_UPRIGHT * angle))

    def drop(self, pointer: Pointer) -> None:
        """Let go: there, or with Shift as one with the puppet that is under the pointer."""
        editor, time = self.editor, self.editor.time
        others = [one for one in editor.puppets.standing if one.puppet.id != self.puppet]
        under = puppet_at(others, editor.lens, pointer.at) if pointer.shift else None
        if under is None:
            editor.edit(f"move {self.puppet}", lambda project: self.moved(project, pointer))
            return
        host, notes = under[0].puppet.id, list[str]()

        def change(project: Project) -> Project:
            return merge_puppets(self.moved(project, pointer), host, self.puppet, time, notes=notes)

        if editor.edit(f"merge {self.puppet}", change):
            editor.puppets.choose(host)
            editor.toasts.say(f"{self.puppet} is now part of {host}", *notes[:1])
