"""A live stage or a take as a scene: receives messages, plays them back, and sends commands."""

from __future__ import annotations

import time
from dataclasses import replace

from enliven.wire import Browse, LearnRoom, Lock, Mode, Possess, Release, Resize, Smooth
from enliven_viewer.language import tr
from enliven_viewer.link.feed import Feed
from enliven_viewer.live.performer_numbers import PerformerNumbers
from enliven_viewer.live.possession_choice import PossessionChoice
from enliven_viewer.live.view_report import ViewReporter, is_end_on, turn_to_bones
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.playhead import Playhead
from enliven_viewer.playback.solved_surfaces import SolvedSurfaces
from enliven_viewer.playback.timeline import NS_PER_S
from enliven_viewer.render.camera import CameraView, OrbitCamera
from enliven_viewer.render.overlay_visibility import OverlayVisibility
from enliven_viewer.render.scene import Scene, SceneStyle, make_scene
from enliven_viewer.settings import ViewerSettings

_SILENCE_TIMEOUT_S = 2.0
"""Seconds without a message after which the window may draw less often: four heartbeats of an edge."""
_LONG_WAIT_S = 12.0
"""Seconds of waiting for a local edge after which the window explains the delay. The first start compiles
kernels.
"""


class LiveStage:
    """The performers and characters of one feed, and the orders to it.

    Args:
        feed: source of the document's data.
        take: name of the played take, or empty for a live edge.

    Attributes:
        playhead: the displayed time.
        style: the visible overlays.
        possession: options of the next possession.
        scene: the last displayed scene.
        scrubbing: whether the pointer is dragging the playhead.
        target: the character that orders apply to; None leaves the choice to the edge.
        held, holding: ids of the possessed characters, and of the performers who control a character.
        numbers: displayed numbers of the performers.
        is_local: True if this window started the edge on this machine, so that the window must wait for it.
    """

    def __init__(
        self, feed: Feed, document: Document, settings: ViewerSettings | None = None, *, take: str = ""
    ) -> None:
        self.feed, self.document, self.take = feed, document, take
        self.playhead = Playhead(document.timeline, live=not take, loop=bool(take))
        self.style = SceneStyle()
        self.possession = PossessionChoice()
        self.scene = Scene()
        settings = settings or ViewerSettings()
        self._showing = OverlayVisibility(settings.render, settings.film.overlay_seconds)
        self._view_reporter = ViewReporter()
        self._surfaces = SolvedSurfaces()
        self._since, self.scrubbing = 0.0, False
        self.target: str | None = None
        self.held: set[str] = set()
        self.holding: set[int] = set()
        self.numbers = PerformerNumbers()
        self.is_local = False

    def advance(self, seconds: float) -> None:
        """Processes received messages, and advances the viewer's clock by ``seconds``."""
        self.receive(seconds)
        self.compose(seconds)

    def receive(self, seconds: float) -> None:
        """Processes received messages. The scene stays the same until :meth:`compose`."""
        arrived_count = self.feed.poll(self.document)
        playing = not (self.playhead.live or self.playhead.paused)
        self._since = 0.0 if arrived_count or playing else self._since + seconds

    def compose(self, seconds: float) -> None:
        """Advances the viewer's clock by ``seconds``, and creates the scene of the displayed time."""
        self.playhead.advance(seconds)
        moment = self.playhead.moment()
        style = self._showing.style(self.style, moment, self.playhead.time_ns / NS_PER_S)
        self.scene = self._remove_next_matches(make_scene(self.document, moment, style, self._surfaces))
        self.numbers.update_performers((*(body.id for body in self.scene.bodies), *self.holding))

    @property
    def is_quiet(self) -> bool:
        """Returns True if no data has arrived for a while and nothing is being played back."""
        return self._since > _SILENCE_TIMEOUT_S

    @property
    def present(self) -> tuple[str, ...]:
        """Returns the ids of the characters, and a marker if a person is present. The camera frames the scene
        again when this result changes.
        """
        return (*self.document.characters, *("body" for _ in self.scene.bodies[:1]))

    def possess(self, mode: Mode = "alone") -> None:
        """Requests that the chosen performer, or every free performer, possesses a character."""
        for name in self._order_targets(self.target):
            self.feed.ask(self.order_to_possess(mode, name))

    def order_to_possess(self, mode: Mode, name: str | None) -> Possess:
        """Returns the order to let the chosen performer possess a character with the chosen body parts."""
        return Possess(name, self.possession.body, self.possession.parts, mode)

    def release(self) -> None:
        """Requests to release the chosen character, or the characters of the chosen performer, or all."""
        for name in [self.target] if self.target in self.held else self._order_targets(None):
            self.feed.ask(Release(name, self.possession.body))

    def scale_by_hands(self) -> None:
        """Requests to start or end the gesture that scales a character by the distance between the hands."""
        for name in self._order_targets(self.target)[:1]:
            self.feed.ask(Resize("hands", name, self.possession.body))

    def choose_parts(self, number: int) -> None:
        """Chooses the body parts of the next possession, and shows a preview."""
        self.possession.choose_parts(number)
        self.possess("preview")

    def choose_performer(self) -> None:
        """Chooses the performer of the next possession: the next one in view, or the first that appears."""
        self.possession.next_performer(body.id for body in self.scene.bodies)
        self.possess("preview")

    def change_smoothing(self, step: int) -> None:
        """Requests more (1) or less (-1) smoothing of the chosen performer, or of all in view."""
        present_ids = [body.id for body in self.scene.bodies]
        for body, amount in self.possession.change_smoothing(step, present_ids).items():
            self.feed.ask(Smooth(body, amount))

    def toggle_lock(self) -> None:
        """Toggles the lock. While it is on, only the currently present performers may possess a character."""
        is_locked = not self.possession.locked
        self.feed.ask(Lock(is_locked), lambda: setattr(self.possession, "locked", is_locked))

    def learn_room(self) -> None:
        """Asks the feed to learn the background and the floor again."""
        self.feed.ask(LearnRoom())

    def show_other_match(self, step: int) -> None:
        """Requests another match for every character that waits for a choice."""
        for name in self.scene.boards:
            self.feed.ask(Browse(name, step))

    def show_bones(self, camera: OrbitCamera) -> None:
        """Rotates the camera to a direction in which most of the characters' bones are visible."""
        turn_to_bones(camera, self.scene)

    def report_view(self, view: CameraView) -> None:
        """Reports the viewing direction to the feed if a match is being chosen and the view has changed."""
        if not self.scene.boards:
            return
        look = self._view_reporter.find_change(view, time.monotonic())
        if look is not None:
            self.feed.ask(look)

    def toggle_overlays(self, *names: str) -> None:
        """Switches overlays of the style on, or off if the first of them is on."""
        new_strength = 0.0 if getattr(self.style, names[0]) > 0 else 1.0
        self.style = replace(self.style, **dict.fromkeys(names, new_strength))

    def describe_next_possession(self, view: CameraView) -> str:
        """Returns a text about the next possession, or advice if bones point at the camera.

        Returns an empty text for a take.
        """
        if self.take:
            return ""
        if is_end_on(self.scene, view):
            return tr("Some bones point at the camera: press V to turn the view")
        return self.possession.describe_choice(self.numbers.number_of)

    @property
    def empty_image_text(self) -> str:
        """Returns the text that an image without characters shows."""
        if self.document.characters or len(self.document.timeline):
            return ""
        edge = self.document.edge
        if edge.connected:
            return tr("Waiting for the characters of the stage")
        if self.is_local:
            return edge.message or self.preparation_text
        return edge.message or tr("Waiting for a stage at {0}", edge.address.removeprefix("tcp://"))

    @property
    def preparation_text(self) -> str:
        """Returns the text about a local stage that is still starting."""
        hint = tr(": the first start takes some minutes") if self._since > _LONG_WAIT_S else ""
        return tr("The stage is being prepared{0}", hint)

    def close(self) -> None:
        """Closes the feed."""
        self.feed.close()

    def _remove_next_matches(self, scene: Scene) -> Scene:
        """Returns the scene without match candidates on possessed characters.

        Older edges send these for the next performer.
        """
        boards = {
            name: board
            for name, board in scene.boards.items()
            if board.state != "choosing" or name not in self.held
        }
        return replace(scene, boards=boards)

    def _order_targets(self, character_id: str | None) -> list[str | None]:
        """Returns the characters for an order. None in the list lets the edge choose."""
        if character_id in self.document.characters:
            return [character_id]
        return [None] if len(self.document.characters) > 1 else list(self.document.characters)
