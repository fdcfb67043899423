"""Renders films off-screen, without a window: an MP4 and a contact sheet, timed by the sensor's clock."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from enliven.arrays import Int16, UInt8
from enliven.errors import ResourceError
from enliven.film.writer import FilmWriter
from enliven.supervision.lifetime import parent_is_gone
from enliven_viewer.film.film_strip import FilmStrip
from enliven_viewer.film.sheet import Tiles, write_sheet
from enliven_viewer.live.hud import format_time
from enliven_viewer.live.match_cards import draw_cards, make_cards
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.solved_surfaces import SolvedSurfaces
from enliven_viewer.playback.timeline import NS_PER_S, TimelineMoment
from enliven_viewer.render.camera import FilmCamera
from enliven_viewer.render.gl.context import create_offscreen_context
from enliven_viewer.render.overlay_visibility import OverlayVisibility
from enliven_viewer.render.renderer import EMPTY_BOX, Renderer
from enliven_viewer.render.scene import SceneStyle, make_scene
from enliven_viewer.settings import ViewerSettings

_IDLE_SLEEP_S = 0.005
"""Seconds to sleep if no message has arrived. It is short compared with the 33 ms between two poses."""
_SILENCE_TIMEOUT_S = 3.0
"""Seconds without a pose or a heartbeat after which the edge counts as gone: six missed heartbeats."""
END_MARK = "ended"


class FilmSource(Protocol):
    """A source that fills a document with the contents of a film: any feed, or sampled performances."""

    def poll(self, document: Document) -> int:
        """Adds everything that has arrived since the last call to the document, without waiting. Returns 0 if
        nothing has arrived.
        """
        ...


@dataclass(frozen=True)
class FilmReport:
    """Statistics of a film: number of images, duration, encoder, and mean milliseconds per image."""

    pictures: int
    seconds: float
    codec: str
    draw_ms: float


def make_film(
    feed: FilmSource,
    document: Document,
    film: Path | None,
    sheet: Path | None,
    settings: ViewerSettings | None = None,
    *,
    seconds: float | None = None,
    title: str = "enliven",
    caption: bool = True,
    console: Console | None = None,
    sound: tuple[Int16, int] | None = None,
) -> FilmReport:
    """Renders the feed until it ends, or for ``seconds`` of sensor time.

    Args:
        document: a document with an unbounded timeline. Filmed moments are removed from it.
        film, sheet: output files; None to skip one.
        sound: audio samples that start at the film's first image, and the sample rate.

    Raises:
        ResourceError: if no edge appears in time, OpenGL is missing, or a file cannot be written.
    """
    studio = _Studio(document, settings or ViewerSettings(), caption)
    with ExitStack() as stack:
        # Open the file first, so that an unwritable path is reported before the edge starts.
        writer = stack.enter_context(studio.open_writer(film, sound)) if film else None
        strip = stack.enter_context(FilmStrip(writer, studio.tiles))
        progress = stack.enter_context(_make_progress(console))
        task = progress.add_task("Waiting for the first pose", total=seconds, told="")
        for moment, second in _iterate_moments(feed, document, studio.settings, seconds):
            strip.add(second, studio.draw(moment, second))
            status = f"{format_time(second)}  {1000 * studio.draw_seconds / studio.count:.0f} ms a picture"
            progress.update(task, description="Filming", completed=second, told=status)
    if sheet:
        subtitle = f"{format_time(studio.count / studio.settings.film.rate)} of sensor time"
        write_sheet(sheet, studio.tiles.choose_tiles(), studio.settings.film.columns, title, subtitle)
    length = studio.count / studio.settings.film.rate
    draw_ms = 1000 * studio.draw_seconds / max(studio.count, 1)
    return FilmReport(studio.count, length, writer.codec if writer else "", draw_ms)


class _Studio:
    """The renderer, camera and scene style of a film, from one image to the next."""

    def __init__(self, document: Document, settings: ViewerSettings, caption: bool) -> None:
        self.document, self.settings = document, settings
        self.size = (settings.width, settings.height)
        self._renderer = Renderer(create_offscreen_context(), self.size, settings.render)
        self._text = max(round(settings.height / 35), 10)
        self._canvas: Canvas | None = None
        if caption:
            # Imported here, because only captions need ImGui.
            from enliven_viewer.render.overlay.canvas import Canvas

            self._canvas = Canvas(self._renderer.ctx)
        self._camera = FilmCamera(settings.render.opening)
        self._surfaces = SolvedSurfaces(wait=True)
        film = settings.film
        self._showing = OverlayVisibility(settings.render, film.overlay_seconds)
        self.tiles = Tiles(film.columns * film.rows, film.tile_width)
        self.count, self.draw_seconds = 0, 0.0

    def open_writer(self, path: Path, sound: tuple[Int16, int] | None) -> FilmWriter:
        """Returns the writer of the film file."""
        film = self.settings.film
        return FilmWriter(path, self.size, film.rate, film.bit_rate, film.encoder, sound)

    def draw(self, moment: TimelineMoment, second: float) -> UInt8:
        """Returns the image (H, W, 4) of a moment, ``second`` seconds into the film. The bottom
        row is first.
        """
        started_at = time.perf_counter()
        style = self._showing.style(SceneStyle(), moment, second)
        scene = make_scene(self.document, moment, style, self._surfaces)
        aspect = self.size[0] / self.size[1]
        self._camera.follow(scene.box or EMPTY_BOX, 1 / self.settings.film.rate, aspect)
        view = self._camera.view(aspect)
        self._renderer.draw(scene, view)
        if self._canvas:
            with self._canvas.draw_over(self._renderer.picture.resolved):
                cards = make_cards(scene, view)
                draw_cards(self._canvas, self.size, self.size[1] / 720, self._text, cards)
                self._draw_caption(moment, second)
        picture = self._renderer.picture.read_raw()
        self.count += 1
        self.draw_seconds += time.perf_counter() - started_at
        return picture

    def _draw_caption(self, moment: TimelineMoment, second: float) -> None:
        """Draws the time and the state of the possession in the lower right corner."""
        assert self._canvas is not None
        margin, line = 1.4 * self._text, self._text
        state_text = "possessed" if moment.possessed else "free"
        text = f"{format_time(second)}  ·  {state_text}"
        if moment.props is not None and moment.props.note:
            text = f"{moment.props.note}  ·  {text}"
        right, top = self.size[0] - margin, self.size[1] - margin - line
        self._canvas.text(right + 1, top + 1, text, line, (0.0, 0.0, 0.0, 0.5), align=1.0)
        self._canvas.text(right, top, text, line, (0.95, 0.96, 0.98, 0.8), align=1.0)


def _iterate_moments(
    feed: FilmSource, document: Document, settings: ViewerSettings, seconds: float | None
) -> Iterator[tuple[TimelineMoment, float]]:
    """Yields (moment, second of the film) at the film's frame rate in sensor time, as fast as the feed
    allows.
    """
    timeline, rate = document.timeline, settings.film.rate
    _wait_for_first_moment(feed, document, settings.film.patience)
    start, count = timeline.start_ns, 0
    last_arrival_time = time.monotonic()
    while not parent_is_gone() and (seconds is None or count < round(seconds * rate)):
        due = start + round(count * NS_PER_S / rate)
        is_stream_over = document.edge.phase == END_MARK
        arrived_count = feed.poll(document)
        last_arrival_time = time.monotonic() if arrived_count else last_arrival_time
        is_stream_over = is_stream_over and not arrived_count
        is_edge_gone = (
            not document.edge.connected and time.monotonic() - last_arrival_time > _SILENCE_TIMEOUT_S
        )
        # A moment is complete once the document contains a later one. At the end of the feed, use the last
        # moment although it is slightly earlier than the image's time.
        if timeline.end_ns > due or (
            (is_stream_over or is_edge_gone) and timeline.end_ns > due - 0.5 * NS_PER_S / rate
        ):
            moment = timeline.find_moment(due)
            assert moment is not None
            yield moment, count / rate
            timeline.drop_before(due)
            count += 1
        elif is_stream_over or is_edge_gone:
            return
        elif not arrived_count:
            time.sleep(_IDLE_SLEEP_S)


def _wait_for_first_moment(feed: FilmSource, document: Document, patience: float) -> None:
    """Waits until the document contains a first moment and its characters."""
    deadline = time.monotonic() + patience
    while True:
        arrived_count = feed.poll(document)
        moment = document.timeline.find_moment(document.timeline.end_ns)
        if moment is not None and document.characters and set(moment.poses) <= set(document.characters):
            return
        if not arrived_count:
            if document.edge.phase == END_MARK or time.monotonic() > deadline or parent_is_gone():
                break
            time.sleep(_IDLE_SLEEP_S)
    if document.edge.connected or len(document.timeline):
        raise ResourceError(
            "the edge sent no pose", where=document.edge.address, remedy="Check the output of enliven edge."
        )
    raise ResourceError(
        f"no edge appeared within {patience:g} s",
        where=document.edge.address,
        remedy="Start one with 'enliven edge', or pass its address with --edge.",
    )


def _make_progress(console: Console | None) -> Progress:
    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[told]}"),
        TimeElapsedColumn(),
        console=console or Console(stderr=True),
        transient=False,
    )
