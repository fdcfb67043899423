"""Puppets baked to possessed meshes beside the window; the project is changed when it is done."""

from __future__ import annotations

import logging
from concurrent.futures import Future, ThreadPoolExecutor

from enliven.document import Project, Puppet
from enliven.errors import EnlivenError, InputError
from enliven.examples.baking import BakeError
from enliven.modeling.puppet import bake_puppet
from enliven_viewer.studio.puppets.editing import Editing

log = logging.getLogger(__name__)


class Baking:
    """Bakes one puppet at a time in a thread: it is solved, then fitted by a graph."""

    def __init__(self, editor: Editing) -> None:
        self.editor = editor
        self._pool: ThreadPoolExecutor | None = None
        self._work: tuple[Puppet, Future[tuple[Project, str, BakeError]]] | None = None

    def begin(self, puppet: Puppet) -> None:
        """Bake a puppet as it is now."""
        if self._work is not None:
            self.editor.toasts.say("A puppet is still being baked", "Wait until it is done.")
            return
        self._pool = self._pool or ThreadPoolExecutor(1, "baking")
        self._work = (puppet, self._pool.submit(bake_puppet, self.editor.project, puppet.id))
        self.editor.toasts.say(f"Baking {puppet.id} ...", "You can go on working.")

    def poll(self) -> None:
        """Put a finished result into the project; to be called once a picture."""
        if self._work is None or not self._work[1].done():
            return
        (puppet, work), self._work = self._work, None
        error = work.exception()
        if error is None:
            self._put(puppet, *work.result())
            return
        if not isinstance(error, EnlivenError):
            log.error("baking failed", exc_info=error)
            error = EnlivenError(f"a fault of enliven itself: {type(error).__name__}: {error}")
        self.editor.toasts.complain(error)

    def finish(self) -> None:
        """Wait for it: for sessions without a window."""
        if self._work is not None:
            self._work[1].exception()
            self.poll()

    def _put(self, puppet: Puppet, made: Project, graph: str, error: BakeError) -> None:
        shape = made.graphs[graph]
        streams = [made.streams[part.take] for part in shape.parts]

        def change(project: Project) -> Project:
            if project.puppets.get(puppet.id) is not puppet or graph in project.graphs:
                mend = "Bake it again."
                raise InputError(
                    "it was changed while it was baked", where=f"puppet {puppet.id!r}", mend=mend
                )
            return project.without(puppet.id).with_streams(*streams).with_characters(shape)

        if self.editor.edit(f"bake {puppet.id}", change):
            self.editor.select(graph=graph)
            self.editor.toasts.say(f"{graph} is a possessed mesh now", f"It is {error}. Ctrl+Z goes back.")
