"""The commands of keys on bones."""

from __future__ import annotations

from enliven.document import KEY_STEP, Shape
from enliven.modeling.edits import keys_of, remove_key, set_key
from enliven_viewer.studio.editor import Editor


class KeyCommands:
    """Commands on the keys of the chosen bone at the playhead."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor

    def toggle(self) -> None:
        """Let posing set keys, or change the pose of all moments again."""
        self.editor.keying = not self.editor.keying

    def set(self) -> None:
        """Set a key with what the bone is turned by there."""
        shape, bone, time = self.editor.chosen(Shape), self.editor.selection.handle, self.editor.time
        if shape is not None and bone is not None:
            self.editor.edit("set key", lambda project: set_key(project, shape.id, bone, time))

    def remove(self) -> None:
        """Remove the key at the playhead."""
        shape, bone, number = self.editor.chosen(Shape), self.editor.selection.handle, self._here()
        if shape is not None and bone is not None and number is not None:
            self.editor.edit("remove key", lambda project: remove_key(project, shape.id, bone, number))

    def lacks(self) -> str:
        """What a key lacks."""
        chosen = self.editor.chosen(Shape) is not None and self.editor.selection.handle is not None
        return "" if chosen else "No bone is chosen. Click a node of a shape with bones first."

    def lacks_key(self) -> str:
        """Why there is no key to remove."""
        found = self.lacks()
        return found or ("" if self._here() is not None else "No key is at the playhead.")

    def _here(self) -> int | None:
        shape, bone = self.editor.chosen(Shape), self.editor.selection.handle
        if shape is None or bone is None:
            return None
        near = 0.501 * KEY_STEP  # a key lies on the nearest frame
        keys = keys_of(self.editor.project, shape.id, bone)
        return next((k for k, (time, _) in enumerate(keys) if abs(time - self.editor.time) <= near), None)
