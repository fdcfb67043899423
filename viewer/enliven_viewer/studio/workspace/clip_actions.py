"""The actions of clips and markers."""

from __future__ import annotations

from collections.abc import Iterator

from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.workspace.clip_commands import ClipCommands


def make_clip_actions(c: ClipCommands) -> Iterator[Action]:
    """Yields the actions on the clips under the playhead.

    They apply to the selected lane, or to all lanes if none is selected.
    """
    deeds = (
        ("split", "Split at the playhead", ("shift+s",), "It plays as before, in two clips."),
        ("blend", "Blend with the next", ("shift+b",), "The clip blends into the next one."),
        ("reverse", "Play backwards", ("shift+r",), "The clip plays backwards, in its place."),
        ("mirror", "Swap left and right", ("shift+x",), "Plays the take's mirror image."),
        ("remove", "Remove", ("shift+delete",), "The take stays in the project."),
    )
    for name, label, keys, about in deeds:
        functions = (lambda name=name: c.do(name), lambda name=name: c.lacks(name))
        yield Action(f"clip.{name}", "Clip", label, keys, *functions, about=about)
    about = "Drag it along the ruler; double-click it to name it."
    yield Action(
        "clip.mark", "Clip", "A marker at the playhead", ("shift+m",), c.mark, about=about, apart=True
    )
    yield Action("clip.next_marker", "Clip", "To the next marker", ("shift+right",), lambda: c.jump(1))
    yield Action("clip.marker_before", "Clip", "To the previous marker", ("shift+left",), lambda: c.jump(-1))
