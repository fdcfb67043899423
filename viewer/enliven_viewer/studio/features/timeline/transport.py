"""The actions of the transport: playback, frames, and the in and out points of loops and recordings."""

from __future__ import annotations

from collections.abc import Iterator

from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.editor.editor import Editor


def make_transport_actions(editor: Editor) -> Iterator[Action]:
    """Yields the actions of the transport."""

    def play() -> None:
        editor.playing = not editor.playing

    def step(count: int) -> None:
        editor.scrub(editor.time + count * editor.settings.frame_step)

    def clear_range() -> None:
        editor.marked_range = None

    def describe_missing_range() -> str:
        return "" if editor.marked_range else "No in or out point is set. Press Alt+I and Alt+O to set them."

    yield Action("view.play", "View", "Play or stop", ("space",), play, is_on=lambda: editor.playing)
    yield Action("view.frame_back", "View", "One frame back", ("left",), lambda: step(-1))
    yield Action("view.frame_on", "View", "One frame forward", ("right",), lambda: step(1))
    yield Action("view.start", "View", "To the start", ("home",), lambda: editor.scrub(0.0))
    yield Action("view.end", "View", "To the end", ("end",), lambda: editor.scrub(editor.length))
    description = "The loop and recordings begin here."
    yield Action(
        "view.in_point",
        "View",
        "Set the in point here",
        ("alt+i",),
        lambda: editor.set_loop_point(0),
        about=description,
        apart=True,
    )
    description = "The loop returns to the in point here, and recordings end here."
    yield Action(
        "view.out_point",
        "View",
        "Set the out point here",
        ("alt+o",),
        lambda: editor.set_loop_point(1),
        about=description,
    )
    yield Action(
        "view.whole_loop",
        "View",
        "Loop the whole project",
        ("alt+l",),
        clear_range,
        describe_missing_range,
        about="Removes the in and out points, so that the whole project loops.",
    )
