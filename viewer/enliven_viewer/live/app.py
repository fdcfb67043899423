"""The viewer in a window: poll the feed, move the playhead, draw, show."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import glfw

from enliven.commands import parent_is_gone
from enliven.wire import Browse, Lock, Mode, Possess, Release, Smooth
from enliven_viewer.link import Feed
from enliven_viewer.live.hud import Hud, HudState, timeline_area
from enliven_viewer.live.match_cards import cards_of
from enliven_viewer.live.possession_choice import PossessionChoice
from enliven_viewer.live.view_report import ViewReporter, hidden, turn_to_bones
from enliven_viewer.playback import NS, Document, Playhead, SolvedSurfaces
from enliven_viewer.render import OrbitCamera, Renderer, Scene, SceneStyle, Showing, scene_of
from enliven_viewer.render.gl import window_context
from enliven_viewer.settings import ViewerSettings
from enliven_viewer.window import open_window

_MINIMISED_PAUSE = 0.05
"""Seconds of sleep per turn of the loop while the window is minimised and nothing is drawn."""
_ROOM = 1.14
"""Size of the picture over that of the subject: the bar of the timeline fits below the feet."""


class App:
    """A window that shows what one feed brings.

    Args:
        feed: where the document is filled from.
        take: the name of the take that the feed plays, or empty for a live edge.
    """

    def __init__(
        self,
        feed: Feed,
        document: Document,
        settings: ViewerSettings | None = None,
        *,
        take: str = "",
        hud: bool = True,
    ) -> None:
        self.feed, self.document = feed, document
        self.settings = settings or ViewerSettings()
        self.playhead = Playhead(document.timeline, live=not take, loop=bool(take))
        self.camera = OrbitCamera(self.settings.render.opening)
        self.style, self.help, self.scale = SceneStyle(), False, 1.0
        self._take, self._with_hud = take, hud
        self._showing = Showing(self.settings.render, self.settings.film.overlay_seconds)
        self.possession = PossessionChoice()
        self._view_reporter = ViewReporter()
        self._surfaces = SolvedSurfaces()
        self._framed: tuple[str, ...] | None = None
        self._size = (1, 1)
        self._scene = Scene()
        self._fps = 0.0

    def run(
        self,
        seconds: float | None = None,
        on_frame: Callable[[App, Renderer], None] | None = None,
        listen: Callable[[App, Any], object] | None = None,
    ) -> None:
        """Show the window until it is closed, Ctrl-C, or ``seconds`` have passed.

        Args:
            on_frame: called after every drawn picture.
            listen: called once with the window, to take its keys and its mouse.

        Raises:
            ResourceError: without a display or OpenGL.
        """
        title = f"enliven · {self._take}" if self._take else "enliven"
        with open_window(self.settings.width, self.settings.height, title) as window:
            self._size = glfw.get_framebuffer_size(window)
            size = max(self._size[0], 1), max(self._size[1], 1)
            renderer = Renderer(window_context(), size, self.settings.render)
            hud = Hud(renderer.ctx)
            if listen:
                listen(self, window)
            end = None if seconds is None else time.monotonic() + seconds
            last = time.monotonic()
            while not glfw.window_should_close(window) and not parent_is_gone():
                if end is not None and time.monotonic() > end:
                    break
                now = time.monotonic()
                self._step(window, renderer, hud, now - last)
                if on_frame:
                    on_frame(self, renderer)
                last = now

    def possess(self, mode: Mode = "alone") -> None:
        """Ask the feed to let the chosen performer, or each that is free, possess a character."""
        for name in self._named():
            self.feed.ask(Possess(name, self.possession.body, self.possession.parts, mode))

    def release(self) -> None:
        """Ask the feed to release what the chosen performer holds, or all characters."""
        for name in self._named():
            self.feed.ask(Release(name, self.possession.body))

    def _named(self) -> list[str | None]:
        """The character that an order names; among several the edge finds the one that is meant."""
        return [None] if len(self.document.characters) > 1 else list(self.document.characters)

    def choose_parts(self, number: int) -> None:
        """Choose the parts of the next possession, which are previewed from now on."""
        self.possession.choose(number)
        self.possess("preview")

    def choose_performer(self) -> None:
        """Choose the performer of the next possession: the next one in view, or the first that comes."""
        self.possession.next_performer(body.id for body in self._scene.bodies)
        self.possess("preview")

    def smoother(self, step: int) -> None:
        """Ask the feed to smooth the chosen performer, or all in view, more (1) or less (-1)."""
        present = [body.id for body in self._scene.bodies]
        for body, amount in self.possession.smoother(step, present).items():
            self.feed.ask(Smooth(body, amount))

    def toggle_lock(self) -> None:
        """Ask the feed that only the present performers perform, or all who come again."""
        wanted = not self.possession.locked
        self.feed.ask(Lock(wanted), lambda: setattr(self.possession, "locked", wanted))

    def frame_all(self) -> None:
        """Bring everything into the picture, seen from the front right."""
        if self._scene.box is not None:
            self.camera.frame(self._scene.box, self._aspect, reset=True, room=_ROOM)

    def browse(self, step: int) -> None:
        """Ask the feed for another match, for every character that waits for one to be chosen."""
        for name in self._scene.boards:
            self.feed.ask(Browse(name, step))

    def show_bones(self) -> None:
        """Turn the camera to where most of the bones of the characters can be seen."""
        turn_to_bones(self.camera, self._scene)

    def report_view(self) -> None:
        """Tell the feed the direction of view where a match is being chosen and the view has changed."""
        if not self._scene.boards:
            return
        look = self._view_reporter.changed(self.camera.view(self._aspect), time.monotonic())
        if look is not None:
            self.feed.ask(look)

    def fraction_along(self, x: float) -> float:
        """The place on the timeline, 0..1, of a pixel's column."""
        left, _, width, _ = timeline_area(self._size, self.scale)
        return min(max((x - left) / width, 0.0), 1.0)

    @property
    def _aspect(self) -> float:
        return self._size[0] / max(self._size[1], 1)

    def _step(self, window: Any, renderer: Renderer, hud: Hud, elapsed: float) -> None:
        """Do one turn of the loop: poll, move the playhead, draw, show."""
        glfw.poll_events()
        self.feed.poll(self.document)
        self.playhead.advance(elapsed)
        self.camera.advance(elapsed)
        self._size = glfw.get_framebuffer_size(window)
        if self._size[0] < 1 or self._size[1] < 1:
            time.sleep(_MINIMISED_PAUSE)
            return
        self._fps += (1 / max(elapsed, 1e-3) - self._fps) * min(elapsed * 2, 1.0)
        renderer.resize(self._size)
        moment = self.playhead.moment()
        style = self._showing.style(self.style, moment, self.playhead.time_ns / NS)
        self._scene = scene_of(self.document, moment, style, self._surfaces)
        self._frame_new_subjects()
        self.report_view()
        renderer.draw(self._scene, self.camera.view(self._aspect))
        if self._with_hud:
            self.scale = max(glfw.get_window_content_scale(window)[0], 1.0)
            hud.rescale(self.scale)
            hud.draw(renderer.picture.resolved, self._hud_state())
        renderer.present(renderer.ctx.screen)
        glfw.swap_buffers(window)

    def _frame_new_subjects(self) -> None:
        """Frame everything when a character or the first performer appears."""
        present = (*self.document.characters, *("body" for _ in self._scene.bodies[:1]))
        if self._framed != present and self._scene.box is not None:
            first = self._framed is None
            self.camera.frame(self._scene.box, self._aspect, at_once=first, room=_ROOM)
            self._framed = present

    def _hud_state(self) -> HudState:
        timeline, head = self.document.timeline, self.playhead
        return HudState(
            edge=None if self._take else replace(self.document.edge),
            title=self._take,
            fps=self._fps,
            fraction=head.fraction,
            shown_s=(head.time_ns - timeline.start_ns) / NS,
            length_s=(timeline.end_ns - timeline.start_ns) / NS,
            live=head.live,
            paused=head.paused,
            speed=head.speed,
            notice=self._notice(),
            help=self.help,
            possession="" if self._take else self._possession_words(),
            cards=cards_of(self._scene, self.camera.view(self._aspect)),
            score=self._scene.props.note if self._scene.props is not None else "",
        )

    def _possession_words(self) -> str:
        """The text about the next possession, or about why it cannot be seen."""
        if hidden(self._scene, self.camera.view(self._aspect)):
            return "some bones point at you: V shows more of them"
        return self.possession.words

    def _notice(self) -> str:
        """The text in the middle of an empty picture."""
        if self.document.characters or len(self.document.timeline):
            return ""
        edge = self.document.edge
        if edge.connected:
            return "waiting for the edge's characters"
        return edge.message or f"waiting for an edge at {edge.address}"
