"""The commands of keys over motion: of a bone, of a node, or of the whole."""

from __future__ import annotations

from enliven.document import KEY_STEP
from enliven.modeling.edits import keys_of, remove_key, set_key
from enliven_viewer.studio.editor import Editor


class KeyCommands:
    """Commands on the keys of the selection at the playhead: a bone, a node, or else the whole."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor

    def toggle(self) -> None:
        """Lets posing and moving set keys, or change all moments again."""
        self.editor.keying = not self.editor.keying

    def set(self) -> None:
        """Sets a key with what the thing is turned and moved by there."""
        (name, handle), time = self._thing(), self.editor.time
        if name:
            self.editor.edit("set key", lambda project: set_key(project, name, handle, time))

    def remove(self) -> None:
        """Removes the key at the playhead."""
        (name, handle), number = self._thing(), self._here()
        if number is not None:
            self.editor.edit("remove key", lambda project: remove_key(project, name, handle, number))

    def lacks(self) -> str:
        """Returns why a key is unavailable; empty if it is available."""
        return "" if self._thing()[0] else "Nothing is chosen. Click a shape, or a node of it, first."

    def lacks_key(self) -> str:
        """Returns why there is no key to remove."""
        found = self.lacks()
        return found or ("" if self._here() is not None else "No key is at the playhead.")

    def _thing(self) -> tuple[str, int | None]:
        """Returns the chosen character, and the bone or node; a puppet's control points have key poses
        instead.
        """
        chosen, handle = self.editor.chosen(), self.editor.selection.handle
        if chosen is None:
            return "", None
        return chosen.id, handle if handle is not None and handle < chosen.keyable else None

    def _here(self) -> int | None:
        name, handle = self._thing()
        near = 0.501 * KEY_STEP  # a key lies on the nearest frame
        keys = keys_of(self.editor.project, name, handle) if name else ()
        return next((k for k, (time, _) in enumerate(keys) if abs(time - self.editor.time) <= near), None)
