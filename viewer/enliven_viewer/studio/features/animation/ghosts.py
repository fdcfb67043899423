"""Computes ghosts and motion trails of an editor's characters in the background. One switch shows both."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures import wait as wait_for

import numpy as np

from enliven.document import Project, RigBase
from enliven.errors import EnlivenError
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.animation.ghost_picture import (
    GhostPicture,
    make_ghost_bodies,
    make_trail_rows,
)
from enliven_viewer.studio.features.animation.ghost_times import choose_ghost_times, find_key_times
from enliven_viewer.studio.features.animation.motion_samples import (
    MotionSamples,
    SampleRequest,
    sample_motion,
)
from enliven_viewer.studio.features.animation.trail_points import choose_trail_points

_MAX_CHARACTERS = 3
"""Maximum number of characters with ghosts if none is selected. More would hide one another."""


class Ghosts:
    """The past and future poses of the selected character, or of the first few if none is selected.

    Attributes:
        is_shown: whether ghosts are shown. Nothing is computed while they are off.
    """

    def __init__(self, editor: Editor) -> None:
        self.editor, self.is_shown = editor, False
        self._pool: ThreadPoolExecutor | None = None
        self._samples: dict[str, MotionSamples] = {}
        self._sampling: tuple[str, SampleRequest, Future[MotionSamples]] | None = None
        self._failed_requests: dict[str, SampleRequest] = {}

    def toggle(self) -> None:
        """Shows or hides the ghosts."""
        self.is_shown = not self.is_shown
        if not self.is_shown:
            self._samples.clear()
            self._failed_requests.clear()

    def picture(self) -> GhostPicture | None:
        """Returns the ghosts and trails that have already been computed, or None while they are off.

        Does not block.
        """
        if not self.is_shown:
            return None
        self._collect_samples()
        characters = self._list_shown_characters()
        self._begin([self._sample_request(character) for character in characters])
        return self._draw_ghosts(characters)

    def settle(self) -> GhostPicture | None:
        """Returns the same as :meth:`picture`, but waits until all of it is computed.

        For sessions without a window.
        """
        picture = self.picture()
        while self._sampling is not None:
            wait_for([self._sampling[2]])
            picture = self.picture()
        return picture

    def _draw_ghosts(self, characters: list[RigBase]) -> GhostPicture:
        editor, bodies, rows = self.editor, [], [np.zeros((0, 12), np.float32)]
        for character in characters:
            sampled = self._samples.get(character.id)
            if sampled is None:
                continue
            bodies += make_ghost_bodies(sampled, editor.time)
            is_selected = editor.selection.character == character.id
            handle, chain = (editor.selection.handle, editor.selection.chain) if is_selected else (None, ())
            rest = next(iter(sampled.points.values()))
            points = choose_trail_points(sampled.request.character, rest, handle, chain)
            keys = self._find_keys(sampled.request.project, sampled.request.character)
            rows.append(make_trail_rows(sampled, points, keys, editor.time, editor.lens))
        return GhostPicture(tuple(bodies), np.concatenate(rows))

    def _list_shown_characters(self) -> list[RigBase]:
        """Returns the selected character, or the first few characters without a selection. Puppets have their
        last solved state.
        """
        editor, chosen = self.editor, self.editor.find_selected()
        characters = (
            [chosen] if chosen is not None else list(editor.project.characters.values())[:_MAX_CHARACTERS]
        )
        return [character for character in characters if any(not layer.muted for layer in character.playing)]

    def _sample_request(self, character: RigBase) -> SampleRequest:
        editor, settings = self.editor, self.editor.settings
        project = editor.project
        project, character = editor.rig_editors[character.kind].find_shown(project, character.id)
        step, length = settings.frame_step, editor.length
        first = int(np.ceil(max(editor.time - settings.trail, 0.0) / step))
        last = int(min(editor.time + settings.trail, length) / step)
        keys = self._find_keys(project, character)
        moments = choose_ghost_times(keys, editor.time, length, settings.ghosts, settings.ghost_step)
        return SampleRequest(project, character, first, last, step, moments)

    def _find_keys(self, project: Project, character: RigBase) -> tuple[float, ...]:
        """Returns the times of the keys of a character's selection."""
        chosen = self.editor.selection
        if chosen.character != character.id:
            return find_key_times(project, character)
        return find_key_times(project, character, chosen.handle, chosen.layer)

    def _begin(self, wanted: list[SampleRequest]) -> None:
        """Starts computing the first outdated request, if no computation is running."""
        names = {request.character.id for request in wanted}
        self._samples = {name: sampled for name, sampled in self._samples.items() if name in names}
        if self._sampling is not None:
            return
        for request in wanted:
            name = request.character.id
            sampled, refused = self._samples.get(name), self._failed_requests.get(name)
            if request.matches(refused) or (sampled is not None and request.matches(sampled.request)):
                continue
            self._pool = self._pool or ThreadPoolExecutor(1, "ghosts")
            self._sampling = (name, request, self._pool.submit(sample_motion, request, sampled))
            return

    def _collect_samples(self) -> None:
        """Fetches the finished result from the background thread."""
        if self._sampling is None or not self._sampling[2].done():
            return
        (name, request, future), self._sampling = self._sampling, None
        error = future.exception()
        if error is None:
            self._samples[name] = future.result()
        else:
            if not isinstance(error, EnlivenError):
                # Report only internal errors here. The panel that plays the character reports all others.
                self.editor.toasts.show_any_error(error)
            self._samples.pop(name, None)
            self._failed_requests[name] = request
