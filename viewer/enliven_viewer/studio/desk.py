"""What the window holds together: the editor, the hand, the files, and where its widgets are."""

from __future__ import annotations

from dataclasses import dataclass, field

from enliven.errors import InputError
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.hand import Hand
from enliven_viewer.studio.timeline_hand import TimelineHand

Rectangle = tuple[float, float, float, float]
"""Left, top, right, bottom in the window's pixels."""


@dataclass
class Desk:
    """Everything that panels draw and change; it lives without a window as well.

    Attributes:
        widgets: where each widget was drawn last, by name, so that a session can click on it.
        asking: the id of the dialogue that is open, or empty.
        caption: what a session says of what it does; empty in an artist's hands.
        pressed: the key that a session presses just now.
    """

    editor: Editor
    hand: Hand
    timeline: TimelineHand
    widgets: dict[str, Rectangle] = field(default_factory=dict)
    asking: str = ""
    caption: str = ""
    pressed: str = ""

    @classmethod
    def of(cls, editor: Editor) -> Desk:
        """A desk for an editor."""
        return cls(editor, Hand(editor), TimelineHand(editor))

    def widget(self, name: str) -> Rectangle:
        """Where a widget was drawn last.

        Raises:
            InputError: where it has not been drawn.
        """
        if name not in self.widgets:
            known = ", ".join(sorted(self.widgets))
            raise InputError(
                f"there is no widget {name!r} on the screen", where="session", mend=f"Known: {known}."
            )
        return self.widgets[name]

    def remember(self, name: str) -> None:
        """Note where the last widget is."""
        from imgui_bundle import imgui

        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        self.widgets[name] = (low.x, low.y, high.x, high.y)
