"""The pose tool.

Dragging a handle poses the bone or node that it moves. Dragging the root or the surface turns the whole
character.
"""

from __future__ import annotations

import numpy as np

from enliven.arrays import Float
from enliven.document import ExampleCharacter, Project, RiggedCharacter
from enliven.modeling.edits import drag_handle, find_keys, key_handle
from enliven_viewer.language import later
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.tools.character_drag import CharacterDrag
from enliven_viewer.studio.viewport.overlay import Disc, Overlay
from enliven_viewer.theme import ACCENT, GOOD, QUIET

_NODE_RADIUS_PX = 3.5
"""Radius in pixels of a node's dot."""
_KEYED_NODE_RADIUS_PX = 5.0
"""Radius in pixels of the dot of a node with keys."""


class PoseTool(Tool):
    """A tool that drags one handle. Dragging the root or the surface turns the character in place."""

    name, label, key, icon = "pose", "Pose", "r", "\uf183"

    def __init__(self, editor: Editor) -> None:
        super().__init__(editor)
        self._held_handle: tuple[CharacterDrag, int] | None = None
        self._held_node: tuple[str, int, Float] | None = None

    @property
    def hint(self) -> str:
        """Returns the effect of a release during a drag, otherwise the possible drags."""
        if self._held_handle is not None:
            return "Release to keep the pose. Esc cancels."
        if self.editor.find_selected(ExampleCharacter) is not None:
            return "Drag a puppet sideways to turn it on the spot. Press K to pose the puppet."
        if self.editor.is_auto_key:
            return (
                "Drag a joint, a dot or a whole shape to set a key at the playhead. Shift+K ends this mode."
            )
        return (
            "Drag a joint to turn its bone. Drag the root to turn the whole shape, with Shift about the "
            "vertical axis."
        )

    def press(self, pointer: Pointer) -> bool:
        """Grabs the node below the pointer in the mode with automatic keys, otherwise the handle or the
        surface.

        The surface acts as the root. Returns False if nothing is below the pointer, so that the drag turns
        the view.
        """
        node = self._node_at(pointer)
        if node is not None:
            self.editor.playing, self._held_node = False, node
            self.editor.select_only(node[0], node[1])
            return True
        hit = self.character_at(pointer)
        self._held_handle = (
            None if hit is None else (CharacterDrag(self.editor, hit, pointer), max(hit.handle, 0))
        )
        return hit is not None

    def drag(self, pointer: Pointer) -> None:
        """Poses the grabbed handle or node as a preview."""
        if self._held_handle is not None or self._held_node is not None:
            self.editor.preview_edit(lambda project: self._apply_pose(project, pointer))

    def release(self, pointer: Pointer) -> None:
        """Stores the pose as one edit. In the mode with automatic keys, it becomes a key at the playhead."""
        if self._held_node is not None and self.editor.draft is not None:
            self.editor.edit(later("key {0}", self._held_node[0]), lambda p: self._apply_pose(p, pointer))
        elif self._held_handle is not None and self.editor.draft is not None:
            whole, handle = self._held_handle
            keyed = (
                later("key {0}", whole.character)
                if self.editor.is_auto_key
                else later("pose {0}", whole.character)
            )
            name = keyed if handle else later("turn {0}", whole.description)
            self.editor.edit(name, lambda p: self._apply_pose(p, pointer))
        self._held_handle = self._held_node = None

    def cancel(self) -> None:
        """Cancels the drag. The character returns to its earlier pose."""
        super().cancel()
        self._held_handle = self._held_node = None

    def overlay(self) -> Overlay:
        """Returns the dots of possessed meshes in auto-key mode. Nodes with keys have larger dots."""
        base_overlay, editor = super().overlay(), self.editor
        dots = list[Disc]()
        for character in editor.pickable_characters if editor.is_auto_key else ():
            chosen = editor.selection.handle if editor.selection.character == character.id else None
            for node, (x, y) in enumerate(editor.lens.project(np.asarray(character.nodes, np.float64))[0]):
                keyed = bool(find_keys(editor.project, character.id, node))
                colour = GOOD if node == chosen else ACCENT if keyed else QUIET
                if np.isfinite([x, y]).all():
                    dots.append(
                        Disc(
                            (float(x), float(y)), _KEYED_NODE_RADIUS_PX if keyed else _NODE_RADIUS_PX, colour
                        )
                    )
        return Overlay((*base_overlay.marks, *dots), base_overlay.chain, base_overlay.hovered)

    def _node_at(self, pointer: Pointer) -> tuple[str, int, Float] | None:
        """Returns the possessed mesh's dot under the pointer as (character id, node number, position (3,) in
        metres).
        """
        editor, candidates = self.editor, list[tuple[float, str, int, Float]]()
        for character in editor.pickable_characters if editor.is_auto_key else ():
            nodes = np.asarray(character.nodes, np.float64)
            if len(nodes):
                distances = np.linalg.norm(editor.lens.project(nodes)[0] - np.array(pointer.at), axis=1)
                distances = np.where(np.isfinite(distances), distances, np.inf)
                node = int(distances.argmin())
                candidates.append((float(distances[node]), character.id, node, nodes[node]))
        best = min(candidates, key=lambda candidate: candidate[0], default=None)
        return best[1:] if best is not None and best[0] <= editor.settings.reach else None

    def _apply_pose(self, project: Project, pointer: Pointer) -> Project:
        if self._held_node is not None:
            name, node, position = self._held_node
            return key_handle(
                project, name, node, self.editor.lens.intersect_plane(pointer.at, position), self.editor.time
            )
        assert self._held_handle is not None
        (whole, handle), editor = self._held_handle, self.editor
        if not handle:
            return whole.turn(project, pointer)
        place = editor.lens.intersect_plane(pointer.at, whole.handles[handle])
        keyed = editor.is_auto_key and isinstance(project.character(whole.character), RiggedCharacter)
        change = key_handle if keyed else drag_handle
        return change(project, whole.character, handle, place, editor.time)
