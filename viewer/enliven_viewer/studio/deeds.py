"""What menus and keys do: one method a command, and the table of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from enliven_viewer.studio.editor import Editor


class Deeds:
    """Commands on an editor."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor

    def play(self) -> None:
        """Play, or stop."""
        self.editor.playing = not self.editor.playing

    def step(self, count: int) -> None:
        """Some frames on, or back."""
        self.editor.scrub(self.editor.time + count * self.editor.settings.frame_step)

    def delete(self) -> None:
        """Delete the chosen shape."""
        shape = self.editor.selection.shape
        if shape is not None:
            self.editor.edit("delete", lambda project: project.without_shape(shape))


@dataclass(frozen=True)
class Deed:
    """A command: the menu that it is in, its label, its keys (the first is shown), and what it does."""

    menu: str
    label: str
    keys: tuple[str, ...]
    do: Callable[[Deeds], object]


DEEDS = (
    Deed("Edit", "Undo", ("ctrl+z",), lambda d: d.editor.undo()),
    Deed("Edit", "Redo", ("ctrl+shift+z", "ctrl+y"), lambda d: d.editor.redo()),
    Deed("Edit", "Delete", ("delete", "backspace"), Deeds.delete),
    Deed("View", "Play or stop", ("space",), Deeds.play),
    Deed("View", "A frame back", ("left",), lambda d: d.step(-1)),
    Deed("View", "A frame on", ("right",), lambda d: d.step(1)),
    Deed("View", "To the start", ("home",), lambda d: d.editor.scrub(0.0)),
    Deed("View", "Frame everything", ("f",), lambda d: d.editor.frame_all()),
)
"""Every command."""
