"""A studio session that follows an edge in the same process."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from scanning_edge import ScanningEdge

from enliven.frames import BodyFrame
from enliven.person.body import Body
from enliven.possession import Actor, make_standing_figure
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession

STEP = 33_333_333
"""Nanoseconds between two frames."""


class StagedSession:
    """An edge in this process, and a session that follows it."""

    def __init__(self, folder: Path, *actors: Actor) -> None:
        self.scanning_edge, self.editor = ScanningEdge(actors), Editor()
        self.perform = PerformSession(self.editor, folder)
        self.perform.active_workspace = "Perform"
        self.scanning_edge.followers.append(self)
        self.count, self.present = 0, list[Body]()

    def connect(self) -> None:
        """Follows the edge, and waits until its characters have arrived."""
        self.perform.connect(str(self.scanning_edge.outlet.publisher.endpoint))
        count = len(self.scanning_edge.stage.actors)
        # On a busy machine, a connection counts as lost between two frames.
        self.until(lambda: self.perform.connected and len(self.perform.stage_ids) == count)

    def poll(self) -> None:
        """Advances the session, as each frame of the window does."""
        self.perform.advance(0.02)

    def until(self, done, what: str = "it") -> None:
        """Runs frames with the current people in view until a condition holds."""

        def after_a_frame() -> object:
            self.count += 1
            self.scanning_edge.edge.step(BodyFrame(list(self.present), self.count * STEP, "reel"))
            return done()

        self.scanning_edge.until(after_a_frame, what)

    def run_frames(self, count: int) -> None:
        """Runs ``count`` frames."""
        end = self.count + count
        self.until(lambda: self.count >= end)

    @property
    def held(self) -> set[str]:
        """Returns the characters with a performer attached."""
        return {holder.character for holder in self.perform.holders}

    @property
    def toasts(self) -> list[tuple[str, str]]:
        """Returns the notifications and their advice."""
        return [(toast.text, toast.remedy) for toast in self.editor.toasts.shown]


def person(x: float = 0.0, z: float = -2.5) -> Body:
    return Body(1, make_standing_figure() + np.array([x, 0.0, z]), np.ones(20))


@contextmanager
def staged_sessions(folder: Path) -> Iterator[Callable[..., StagedSession]]:
    """Yields a function that opens a session of an edge with the given actors. Closes all sessions at the
    end.
    """
    opened: list[StagedSession] = []

    def make(*actors: Actor) -> StagedSession:
        opened.append(StagedSession(folder, *actors))
        return opened[-1]

    yield make
    for session in opened:
        session.perform.disconnect()
        session.scanning_edge.close()
