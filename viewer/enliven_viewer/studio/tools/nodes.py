"""The tools that insert a node into a bone and remove a node. The motion stays the same."""

from __future__ import annotations

from enliven.document import Project
from enliven.modeling.rigged.nodes import insert_node, remove_node
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.tools.base import Pointer, Tool
from enliven_viewer.studio.viewport.overlay import Disc, Overlay
from enliven_viewer.studio.viewport.picking import Hit, find_bone_at, find_joint_at
from enliven_viewer.theme import CUT, STROKE


class InsertTool(Tool):
    """A tool that inserts a node where a bone is clicked."""

    name, label, key, icon = "insert", "Add node", "i", "\uf055"

    @property
    def hint(self) -> str:
        """Returns the effect of a click on a bone."""
        return "Click a bone to add a node to it. The total rotation along the chain stays the same."

    def handle_at(self, pointer: Pointer) -> Hit | None:
        """Returns the bone under the pointer. Joints are ignored, because a click inserts a node between
        them.
        """
        editor = self.editor
        return find_bone_at(editor.editable_characters, editor.lens, pointer.at, editor.settings.reach)

    def press(self, pointer: Pointer) -> bool:
        """Inserts a node at the clicked place of a bone and selects it. Returns False if no bone is there."""
        hit = self.handle_at(pointer)
        if hit is None:
            return False
        names: list[str] = []

        def change(project: Project) -> Project:
            project, name = insert_node(project, hit.character, hit.handle, hit.along)
            names.append(name)
            return project

        if self.editor.edit("add node", change):
            new_handle = self.editor.project.characters[hit.character].handles.index(names[-1])
            self.editor.select(character=hit.character, handle=new_handle, chain=())
            self.hovered = None
        return True

    def overlay(self) -> Overlay:
        """Returns the usual marks, with a ring where a click would insert the node."""
        base_overlay, pixel = super().overlay(), self.on_bone(self.hovered)
        return (
            base_overlay
            if pixel is None
            else Overlay((Disc(pixel, 7.0, STROKE, 2.5),), base_overlay.chain, base_overlay.hovered)
        )


class RemoveTool(Tool):
    """A tool that removes a clicked joint. The joint's children are attached to its parent."""

    name, label, key, icon = "remove", "Remove node", "x", "\uf056"

    @property
    def hint(self) -> str:
        """Returns the effect of a click on a joint."""
        return (
            "Click a joint to remove it. The bones on both sides become one bone, which keeps both motions."
        )

    def handle_at(self, pointer: Pointer) -> Hit | None:
        """Returns the joint under the pointer. Characters without bones are ignored."""
        editor = self.editor
        return find_joint_at(
            [character for character in editor.editable_characters if character.bones],
            editor.lens,
            pointer.at,
            editor.settings.reach,
        )

    def press(self, pointer: Pointer) -> bool:
        """Removes the clicked joint. Returns False if no joint is there."""
        hit = self.handle_at(pointer)
        if hit is None:
            return False
        remove_joint(self.editor, hit.character, hit.handle)
        self.hovered = None
        return True

    def overlay(self) -> Overlay:
        """Returns the usual marks, with a ring around the joint that a click would remove."""
        base_overlay, pixel = super().overlay(), self.on_bone(self.hovered)
        return (
            base_overlay
            if pixel is None
            else Overlay((Disc(pixel, 10.0, CUT, 2.5),), base_overlay.chain, None)
        )


def remove_joint(editor: Editor, shape: str, joint: int) -> None:
    """Removes a joint from a shape."""
    if editor.edit("remove node", lambda project: remove_node(project, shape, joint)):
        editor.select(character=shape, handle=None, chain=())
