"""The move tool.

Dropping a character's root on another character's node, or dropping it with Shift, merges the two.
"""

from __future__ import annotations

import numpy as np
import scipy

from enliven.arrays import Float, Int32
from enliven.document import Project
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.tools.character_drag import CharacterDrag
from enliven_viewer.studio.viewport.overlay import Disc, Label, Line, Overlay
from enliven_viewer.studio.viewport.picking import Hit, find_bone_at, find_joint_at
from enliven_viewer.theme import GOOD, INK, STROKE

_SNAP_PX = 26.0
"""Maximum distance in pixels at which a dragged root snaps to a node and merges. For bones, half of this
distance applies.
"""
_MERGE_DISTANCE = 0.05
"""Maximum distance to another character for a merge with Shift, as a fraction of the dragged character's
size.
"""
_MAX_COMPARED_VERTICES = 4000
"""Maximum number of vertices of the dragged mesh that are compared with other meshes, so that dragging a scan
stays smooth.
"""


class MoveTool(Tool):
    """A tool that moves a character parallel to the image plane.

    It merges the character if its root comes near a node or a bone.
    """

    name, label, key, icon = "carry", "Move, merge", "g", "\uf047"
    plays_on = True

    def __init__(self, editor: Editor) -> None:
        super().__init__(editor)
        self._held_character: CharacterDrag | None = None
        self._merge_host: Hit | None = None
        self._other_trees: list[tuple[str, scipy.spatial.cKDTree]] = []

    @property
    def hint(self) -> str:
        """Returns the effect of a release now, or the ways to move and to merge."""
        if self._merge_host is not None:
            return "Release to merge here. Both shapes keep their motion."
        if self._held_character is not None and self._held_character.rooted:
            return (
                "Release anywhere to move the shape. Release its red root on a node of another shape to "
                "merge the two."
            )
        if self._held_character is not None:
            return (
                "Release anywhere to move the shape. Release with Shift over another shape, or where "
                "both touch, to merge the two."
            )
        if self.editor.selection.character is not None and not self._is_selection_rooted:
            return "Drag the shape to move it. Release with Shift over another shape to merge the two."
        return "Drag a shape to move it. Drop its red root on another shape's node to merge the two."

    @property
    def _is_selection_rooted(self) -> bool:
        return any(
            character.id == self.editor.selection.character for character in self.editor.editable_characters
        )

    def press(self, pointer: Pointer) -> bool:
        """Starts to move the character under the pointer. Returns False if there is none."""
        hit = self.character_at(pointer)
        self._held_character = None if hit is None else CharacterDrag(self.editor, hit, pointer)
        self._other_trees = []
        if hit is not None:
            self.editor.select(handle=None)
        return hit is not None

    def drag(self, pointer: Pointer) -> None:
        """Moves the character as a preview, and finds the target of a merge.

        The target is a joint or bone near the moved root. With Shift it is the character below or next to the
        pointer.
        """
        held, editor = self._held_character, self.editor
        if held is None:
            return
        editor.preview_edit(lambda project: held.move(project, pointer))
        pixels = (
            editor.lens.project_visible(editor.stage_character(held.character).handles[:1])
            if held.rooted
            else []
        )
        if pixels and not held.has_several:
            others = [character for character in editor.editable_characters if character.id != held.character]
            lens, root_pixel = editor.lens, pixels[0]
            self._merge_host = find_joint_at(others, lens, root_pixel, _SNAP_PX) or find_bone_at(
                others, lens, root_pixel, _SNAP_PX / 2
            )
        elif not held.has_several:
            self._merge_host = self._find_merge_target(pointer) if pointer.shift else None

    def release(self, pointer: Pointer) -> None:
        """Merges at the playhead if there is a target, otherwise moves the character. A merge keeps the pose
        and the motion of both characters.
        """
        (held, host), self._held_character, self._merge_host = (
            (self._held_character, self._merge_host),
            None,
            None,
        )
        editor = self.editor
        if held is None or editor.draft is None:
            return
        name, notes = held.character, list[str]()
        if host is None and pointer.shift and not held.has_several:
            host = self._find_merge_target(pointer)
        if host is None:
            editor.edit(later("move {0}", held.description), lambda project: held.move(project, pointer))
            if pointer.shift:
                self._report_no_merge(held)
            return
        other = host

        def change(project: Project) -> Project:
            # A merge at a node also positions the character, so do not move it first.
            moved = project if other.handle >= 0 else held.move(project, pointer)
            return held.merge(moved, other, notes)

        if editor.edit(later("merge {0}", name), change):
            editor.select_only(other.character)
            editor.toasts.show_message(
                tr("{0} is now part of {1}", name, other.character), tr("Ctrl+Z separates the two again.")
            )
            for note in notes[-2:]:  # The last note reports whether the two surfaces touch.
                editor.toasts.show_message(note)

    def _find_merge_target(self, pointer: Pointer) -> Hit | None:
        """Returns the target of a merge with Shift: the character under the pointer, or the nearest
        character.
        """
        held = self._held_character
        if held is None:
            return None
        return self.character_at(pointer, without=held.character) or self._find_touched_character(held)

    def _find_touched_character(self, held: CharacterDrag) -> Hit | None:
        """Returns the character that the dragged character touches or nearly touches."""
        vertices = self.editor.stage_character(held.character).vertices
        if not len(vertices):
            return None
        if not self._other_trees:
            # Compute this only once. Playback pauses during a drag, so the other characters do not move.
            self._other_trees = [
                (
                    character.id,
                    scipy.spatial.cKDTree(
                        _add_face_centres(character.vertices, character.character.mesh.faces)
                    ),
                )
                for character in self.editor.pickable_characters
                if character.id != held.character and character.character.mesh is not None
            ]
        max_gap = _MERGE_DISTANCE * float(np.linalg.norm(np.ptp(vertices, axis=0)))
        step = -(-len(vertices) // _MAX_COMPARED_VERTICES)
        gaps = [
            (float(tree.query(vertices[::step], distance_upper_bound=max_gap)[0].min()), name)
            for name, tree in self._other_trees
        ]
        gap, name = min(gaps, default=(np.inf, ""))
        return Hit(name) if gap < max_gap else None

    def _report_no_merge(self, held: CharacterDrag) -> None:
        """Shows a message with the reason why a drop with Shift did not merge."""
        if held.has_several:
            problem, remedy = (
                tr("Several shapes were moved, so none was merged"),
                tr("Choose one shape, and release it with Shift."),
            )
        elif not [
            character for character in self.editor.pickable_characters if character.id != held.character
        ]:
            problem, remedy = (
                tr("You need a second shape to merge"),
                tr("Sketch or open a second shape. Locked shapes cannot be merged."),
            )
        else:
            problem, remedy = (
                tr("No shape is near {0}", held.character),
                tr("Release over another shape, or where both shapes touch."),
            )
        self.editor.toasts.show_message(problem, remedy)

    def cancel(self) -> None:
        """Cancels the move. The character returns to its earlier place."""
        super().cancel()
        self._held_character = self._merge_host = None

    def overlay(self) -> Overlay:
        """Returns the usual marks. If a release would merge, also marks the target."""
        base_overlay = super().overlay()
        if self._held_character is not None and self._merge_host is not None and self._merge_host.handle < 0:
            return self._name_overlay(self._held_character, self._merge_host, base_overlay)
        node = self.on_bone(self._merge_host)
        if self._held_character is None or node is None:
            return base_overlay
        root = self.editor.lens.project_visible(
            self.editor.stage_character(self._held_character.character).handles[:1]
        )
        marks = (
            *(Line((root_pixel, node), STROKE, 2.0) for root_pixel in root),
            Disc(node, 13.0, GOOD, 3.0),
            Label((node[0] + 20, node[1]), "merge", INK),
        )
        return Overlay(marks, base_overlay.chain, base_overlay.hovered)

    def _name_overlay(self, held: CharacterDrag, host: Hit, base_overlay: Overlay) -> Overlay:
        """Returns the overlay that names the merge target above the dragged character."""
        vertices, lens = self.editor.stage_character(held.character).vertices, self.editor.lens
        top = vertices.mean(0) + np.ptp(vertices @ lens.up) / 2 * lens.up
        marks = tuple(
            Label(pixel, tr("merge with {0}", host.character), INK)
            for pixel in lens.project_visible(top[None])
        )
        return Overlay(marks, base_overlay.chain, base_overlay.hovered)


def _add_face_centres(vertices: Float, faces: Int32) -> Float:
    """Returns vertices and face centres, (V + F, 3) in metres. The centres make distances to large faces
    accurate enough.
    """
    return np.concatenate([vertices, vertices[faces].mean(1)])
