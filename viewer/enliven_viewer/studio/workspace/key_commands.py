"""Commands for motion keys of a bone, a node or a whole character."""

from __future__ import annotations

from enliven.document import KEY_STEP
from enliven.modeling.edits import find_keys, remove_key, set_key
from enliven_viewer.studio.editor.editor import Editor


class KeyCommands:
    """Commands for the keys at the playhead. They apply to the selected bone or node, or to the whole
    character.
    """

    def __init__(self, editor: Editor) -> None:
        self.editor = editor

    def toggle(self) -> None:
        """Switches auto-key mode. In this mode, posing and moving set keys. Otherwise they
        change all times.
        """
        self.editor.is_auto_key = not self.editor.is_auto_key

    def set(self) -> None:
        """Sets a key with the current rotation and offset of the selection."""
        (name, handle), time = self._find_subject(), self.editor.time
        if name:
            self.editor.edit("set key", lambda project: set_key(project, name, handle, time))

    def remove(self) -> None:
        """Removes the key at the playhead."""
        (name, handle), number = self._find_subject(), self._find_key_at_playhead()
        if number is not None:
            self.editor.edit("remove key", lambda project: remove_key(project, name, handle, number))

    def describe_missing(self) -> str:
        """Returns the reason why no key can be set, or an empty text if a key can be set."""
        return "" if self._find_subject()[0] else "Nothing is chosen. Click a shape or a node first."

    def describe_missing_key(self) -> str:
        """Returns the reason why no key can be removed, or an empty text if a key can be removed."""
        reason = self.describe_missing()
        return reason or ("" if self._find_key_at_playhead() is not None else "No key is at the playhead.")

    def _find_subject(self) -> tuple[str, int | None]:
        """Returns the selected character and the bone or node.

        Control points of puppets are excluded, because they have key poses instead.
        """
        chosen, handle = self.editor.find_selected(), self.editor.selection.handle
        if chosen is None:
            return "", None
        return chosen.id, handle if handle is not None and handle < chosen.keyable else None

    def _find_key_at_playhead(self) -> int | None:
        name, handle = self._find_subject()
        # Keys are at whole frames, so a tolerance of half a frame finds the key of the nearest frame.
        near = 0.501 * KEY_STEP
        keys = find_keys(self.editor.project, name, handle) if name else ()
        return next((k for k, (time, _) in enumerate(keys) if abs(time - self.editor.time) <= near), None)
