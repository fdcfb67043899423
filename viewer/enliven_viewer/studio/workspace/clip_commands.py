"""The commands of clips and markers."""

from __future__ import annotations

from collections.abc import Callable

from enliven.document import Project
from enliven.modeling.edits import (
    add_marker,
    blend_clips,
    clips_of,
    mirror_layers,
    remove_clip,
    remove_layer,
    reverse_clip,
    split_clip,
)
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.timeline import Lane, TimelineLayout

_BLEND = 0.4
"""Seconds of a blend that is made by key: about a step."""
_PAST = 1e-6
"""Seconds: the marker under the playhead is neither the next nor the one before."""


class ClipCommands:
    """Commands on the clips under the playhead: of the chosen lane, or of all where none is chosen."""

    def __init__(self, editor: Editor) -> None:
        self.editor = editor

    def split(self) -> None:
        """Split the clips under the playhead."""
        time = self.editor.time
        self._change("split clip", lambda project, name, numbers, _: split_clip(project, name, numbers, time))

    def reverse(self) -> None:
        """Play the clip under the playhead backwards."""
        self._change("reverse clip", reverse_clip)

    def mirror(self) -> None:
        """Play the mirror image of the lane's take, or no longer."""
        self._change("mirror motion", lambda project, name, numbers, _: mirror_layers(project, name, numbers))

    def blend(self) -> None:
        """Let the clip under the playhead go over into the next."""

        def change(project: Project, name: str, numbers: tuple[int, ...], clip: int) -> Project:
            return blend_clips(project, name, numbers, clip, _BLEND)

        self._change("blend clips", change)

    def remove(self) -> None:
        """Remove the clip under the playhead; the last one of a lane goes with its layer."""

        def change(project: Project, name: str, numbers: tuple[int, ...], clip: int) -> Project:
            if len(clips_of(project, name, numbers[0])) > 1:
                return remove_clip(project, name, numbers, clip)
            for number in sorted(numbers, reverse=True):
                project = remove_layer(project, name, number)
            return project

        self._change("remove clip", change)

    def mark(self) -> None:
        """Put a marker at the playhead."""
        time = self.editor.time
        self.editor.edit("add marker", lambda project: add_marker(project, time)[0])

    def jump(self, way: int) -> None:
        """Go to the next marker, or with a way of -1 to the one before."""
        times = sorted(
            {0.0, self.editor.length, *(one.seconds for one in self.editor.project.markers.values())}
        )
        ahead = [time for time in times if (time - self.editor.time) * way > _PAST]
        if ahead:
            self.editor.scrub(min(ahead) if way > 0 else max(ahead))

    def _change(self, word: str, change: Callable[[Project, str, tuple[int, ...], int], Project]) -> None:
        """Do an edit of the clips under the playhead."""
        time = self.editor.time
        found = [
            (lane, next(k for k, clip in enumerate(lane.clips) if clip.begin <= time <= clip.end))
            for lane in self._lanes()
        ]

        def every(project: Project) -> Project:
            for lane, clip in found:
                project = change(project, lane.character.id, lane.layers, clip)
            return project

        if found:
            self.editor.edit(word, every)

    def _lanes(self) -> list[Lane]:
        """The chosen lane, or else all, where a clip is under the playhead."""
        editor, chosen = self.editor, self.editor.selection
        lanes = TimelineLayout(editor.project, editor.length, 1.0).bars()
        mine = [one for one in lanes if one.character.id == chosen.character and chosen.layer in one.layers]
        under = [
            one
            for one in (mine or [lane for lane in lanes if not lane.layer.muted])
            if any(clip.begin <= editor.time <= clip.end for clip in one.clips)
        ]
        if not under:
            editor.toasts.say("No clip is under the playhead", "Put the playhead over one.")
        return under
