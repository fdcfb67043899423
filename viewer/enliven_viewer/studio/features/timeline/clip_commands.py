"""The commands and actions of clips and markers."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from enliven.document import Project
from enliven.errors import InputError
from enliven.modeling.edits import (
    add_marker,
    blend_clips,
    find_layer_clips,
    mirror_layers,
    remove_clip,
    remove_layer,
    reverse_clip,
    split_clip,
)
from enliven_viewer.language import later
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.editor.editor import Edit, Editor
from enliven_viewer.studio.features.timeline.layout import Lane, TimelineLayout

_BLEND_S = 0.4
"""Duration, in seconds, of a blend made with the shortcut: about one step."""
_TIME_TOLERANCE_S = 1e-6
"""Tolerance in seconds. A marker closer to the playhead than this is neither the next nor the previous
marker.
"""


def _split_clip(project: Project, name: str, numbers: tuple[int, ...], _: int, time: float) -> Project:
    return split_clip(project, name, numbers, time)


def _blend_clips(project: Project, name: str, numbers: tuple[int, ...], clip: int, _: float) -> Project:
    return blend_clips(project, name, numbers, clip, _BLEND_S)


def _reverse_clip(project: Project, name: str, numbers: tuple[int, ...], clip: int, _: float) -> Project:
    return reverse_clip(project, name, numbers, clip)


def _mirror_clip(project: Project, name: str, numbers: tuple[int, ...], clip: int, _: float) -> Project:
    return mirror_layers(project, name, numbers)


def _remove_clip(project: Project, name: str, numbers: tuple[int, ...], clip: int, _: float) -> Project:
    """Removes a clip. Removing the last clip of a lane also removes the lane's layers."""
    if len(find_layer_clips(project, name, numbers[0])) > 1:
        return remove_clip(project, name, numbers, clip)
    for number in sorted(numbers, reverse=True):
        project = remove_layer(project, name, number)
    return project


_CLIP_EDITS: dict[str, tuple[str, Callable[[Project, str, tuple[int, ...], int, float], Project]]] = {
    "split": (later("split clip"), _split_clip),
    "blend": (later("blend clips"), _blend_clips),
    "reverse": (later("reverse clip"), _reverse_clip),
    "mirror": (later("mirror motion"), _mirror_clip),
    "remove": (later("remove clip"), _remove_clip),
}
"""The edits on clips under the playhead by id, each with its title in the history and the function that edits
one clip.
"""


class ClipCommands:
    """Commands on the clips under the playhead, in the selected lane or in all lanes if none is selected."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor

    def run_edit(self, edit_id: str) -> None:
        """Splits, blends, reverses, mirrors or removes the clips under the playhead."""
        self.editor.edit(_CLIP_EDITS[edit_id][0], self._make_edit(edit_id))

    def find_missing(self, edit_id: str) -> str:
        """Returns the reason why an edit is unavailable, with advice, or an empty text if it is available."""
        if not self._find_lanes():
            return "No clip is under the playhead. Move the playhead over a clip."
        try:
            self._make_edit(edit_id)(self.editor.project)
        except InputError as error:
            return f"{error.what[0].upper()}{error.what[1:]}. {error.remedy}"
        return ""

    def _make_edit(self, edit_id: str) -> Edit:
        """Returns the edit of all affected clips."""
        time, change = self.editor.time, _CLIP_EDITS[edit_id][1]
        lane_clips = [
            (lane, next(k for k, clip in enumerate(lane.clips) if clip.begin <= time <= clip.end))
            for lane in self._find_lanes()
        ]

        def every(project: Project) -> Project:
            # Start with the last lane, because removing a lane changes the numbers of the lanes after it.
            for lane, clip in reversed(lane_clips):
                project = change(project, lane.character.id, lane.layers, clip, time)
            return project

        return every

    def add_marker_at_playhead(self) -> None:
        """Puts a marker at the playhead."""
        time = self.editor.time
        self.editor.edit("add marker", lambda project: add_marker(project, time)[0])

    def go_to_marker(self, direction: int) -> None:
        """Moves the playhead to the next marker, or to the previous one if `direction` is -1."""
        times = sorted(
            {0.0, self.editor.length, *(marker.seconds for marker in self.editor.project.markers.values())}
        )
        ahead = [time for time in times if (time - self.editor.time) * direction > _TIME_TOLERANCE_S]
        if ahead:
            self.editor.scrub(min(ahead) if direction > 0 else max(ahead))

    def _find_lanes(self) -> list[Lane]:
        """Returns the selected lane, or all unmuted lanes without a selection. Lanes without a clip under the
        playhead are excluded.
        """
        editor, chosen = self.editor, self.editor.selection
        lanes = TimelineLayout(editor.length, 1.0, project=editor.project).bars()
        selected_lanes = [
            lane for lane in lanes if lane.character.id == chosen.character and chosen.layer in lane.layers
        ]
        candidates = selected_lanes or [lane for lane in lanes if not lane.layer.muted]
        return [
            lane for lane in candidates if any(clip.begin <= editor.time <= clip.end for clip in lane.clips)
        ]


def make_clip_actions(c: ClipCommands) -> Iterator[Action]:
    """Yields the actions on the clips under the playhead.

    They apply to the selected lane, or to all lanes if none is selected.
    """
    deeds = (
        (
            "split",
            "Split at the playhead",
            ("shift+s",),
            "Splits the clip into two. The motion does not change.",
        ),
        (
            "blend",
            "Blend into the next clip",
            ("shift+b",),
            "Blends the clip into the next clip on its lane.",
        ),
        (
            "reverse",
            "Play backwards",
            ("shift+r",),
            "The clip plays backwards. Its place on the timeline does not change.",
        ),
        ("mirror", "Swap left and right", ("shift+x",), "Plays the take's mirror image."),
        ("remove", "Remove", ("shift+delete",), "The take stays in the project."),
    )
    for name, label, keys, description in deeds:
        functions = (lambda name=name: c.run_edit(name), lambda name=name: c.find_missing(name))
        yield Action(f"clip.{name}", "Clip", label, keys, *functions, about=description)
    description = "Drag the marker along the ruler. Double-click the marker to name it."
    yield Action(
        "clip.mark",
        "Clip",
        "Add a marker at the playhead",
        ("shift+m",),
        c.add_marker_at_playhead,
        about=description,
        apart=True,
    )
    yield Action(
        "clip.next_marker", "Clip", "To the next marker", ("shift+right",), lambda: c.go_to_marker(1)
    )
    yield Action(
        "clip.marker_before", "Clip", "To the previous marker", ("shift+left",), lambda: c.go_to_marker(-1)
    )
