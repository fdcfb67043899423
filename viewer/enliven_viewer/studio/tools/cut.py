"""The cut tool. A stroke across a bone splits a shape into two, and both parts keep their motion."""

from __future__ import annotations

import numpy as np

from enliven.document import Project
from enliven.errors import EnlivenError
from enliven.modeling.edits import cut_character
from enliven.modeling.mesh.cut_surfaces import StrokeCut
from enliven_viewer.language import tr, tr_n
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.tools.base import Pointer, StrokeTool
from enliven_viewer.studio.viewport.overlay import Disc, Line, Overlay, Point
from enliven_viewer.studio.viewport.picking import Hit, find_crossings
from enliven_viewer.theme import CUT


class CutTool(StrokeTool):
    """A tool that cuts every bone that a stroke crosses, at the playhead."""

    name, label, key, icon = "cut", "Cut", "c", "\uf0c4"

    def __init__(self, editor: Editor) -> None:
        super().__init__(editor)
        self._crossed_bones: list[Hit] = []

    @property
    def hint(self) -> str:
        """Returns the number of bones that a release would cut, or the way to draw a stroke."""
        if self._crossed_bones:
            count = len(self._crossed_bones)
            return tr_n(
                "Release to cut {0} bone. Esc cancels the stroke.",
                "Release to cut {0} bones. Esc cancels the stroke.",
                count,
            )
        if self._stroke:
            return "Draw across a bone."
        return "Draw a stroke across a limb to cut it. Both parts keep their current pose and their motion."

    def press(self, pointer: Pointer) -> bool:
        """Starts a stroke that crosses no bones yet."""
        self._crossed_bones, self.hovered = [], None
        return super().press(pointer)

    def drag(self, pointer: Pointer) -> None:
        """Extends the stroke, and finds the bones that it crosses. Does nothing else for a very short
        movement.
        """
        count, editor = len(self._stroke), self.editor
        super().drag(pointer)
        if len(self._stroke) == count:
            return
        hits = find_crossings(editor.editable_characters, editor.lens, np.array(self._stroke))
        # If the stroke crosses the selected shape, cut only that shape, not those behind or in front of it.
        self._crossed_bones = [hit for hit in hits if hit.character == editor.selection.character] or hits

    def release(self, pointer: Pointer) -> None:
        """Cuts the characters that the stroke crosses, at the current time."""
        stroke, crossed, self._crossed_bones = self.take_points(), self._crossed_bones, []
        if not stroke:
            return
        names = list(dict.fromkeys(hit.character for hit in crossed)) or self._list_boneless_characters(
            stroke
        )
        if not names:
            self.editor.toasts.show_message(
                tr("The stroke crosses no bone"), tr("Draw the stroke across a limb, from side to side.")
            )
            return
        time, surface, notes, parts = (
            self.editor.time,
            self._make_cut_surface(stroke),
            list[str](),
            list[str](),
        )

        def change(project: Project) -> Project:
            refused: EnlivenError | None = None
            for name in names:
                try:
                    project, pieces = cut_character(project, name, surface, time, notes=notes)
                    parts.extend(pieces[1:])
                # If the cut surface does not pass through a character, the character is not cut.
                except EnlivenError as error:
                    refused = error
            if refused is not None and (crossed or not parts):
                raise refused
            return project

        if self.editor.edit("cut", change):
            self.editor.select_only(parts[-1])
            message = tr("Cut off: {0}", ", ".join(parts)) + "".join(f". {note}" for note in notes[:1])
            self.editor.toasts.show_message(
                message, tr("All parts keep their current pose and their motion. Press G to drag a part.")
            )

    def _list_boneless_characters(self, stroke: list[Point]) -> list[str]:
        """Returns the characters without bones that a stroke may cut: the selected character,
        otherwise all.
        """
        if len(stroke) < 2:
            return []
        boneless = [character.id for character in self.editor.pickable_characters if not character.bones]
        chosen = self.editor.selection.character
        return [chosen] if chosen in boneless else boneless

    def _make_cut_surface(self, stroke: list[Point]) -> StrokeCut:
        """Returns the surface swept by the stroke along the view direction, in pixels with y up."""
        lens = self.editor.lens
        width, height = lens.size
        clip = lens.view.clip_from_world
        picture = np.stack(
            [width / 2 * (clip[0] + clip[3]), height / 2 * (clip[1] + clip[3]), clip[2], clip[3]]
        )
        return StrokeCut(np.array([(x, height - y) for x, y in stroke]), picture)

    def cancel(self) -> None:
        """Drops the stroke, and forgets the crossed bones."""
        super().cancel()
        self._crossed_bones = []

    def overlay(self) -> Overlay:
        """Returns the stroke, with a disc on each bone that it crosses."""
        if len(self._stroke) < 2:
            return Overlay()
        marks: list[Line | Disc] = [Line(tuple(self._stroke), CUT, 2.5)]
        marks += [
            Disc(crossing, 5.0, CUT)
            for crossing in map(self.on_bone, self._crossed_bones)
            if crossing is not None
        ]
        return Overlay(tuple(marks))
