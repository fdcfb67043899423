"""Performances that a kiosk plays while it has no visitors: recorded bodies that control its characters, and
takes.
"""

from __future__ import annotations

import logging
import math
import random
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Protocol

import numpy as np

from enliven.arrays import Float32
from enliven.deformation.graph.graph import graph_from_character
from enliven.document import Character
from enliven.errors import EnlivenError, InputError
from enliven.frames import BodyFrame
from enliven.kiosk.visitors import Place
from enliven.person import Body, Joint
from enliven.possession import EmbeddedActor
from enliven.recording import BODIES_TOPIC, Recording
from enliven_viewer.link.take_feed import TakeFeed
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.interpolation import blend_bodies
from enliven_viewer.playback.timeline import NS_PER_S, Timeline
from enliven_viewer.render.scene import SceneCharacter

log = logging.getLogger(__name__)

_PAUSE_S = 2.5
"""Seconds between two performances. Meanwhile the character returns to its rest pose and looks around."""
_RELEASE_S = 1.2
"""Seconds in which the character returns to its rest pose after the recorded body has left."""
_MAX_STEP_S = 0.1
"""Maximum time step of a visit in seconds. At a low frame rate the visit slows down instead of distorting the
mesh.
"""


@dataclass(frozen=True)
class SpotContent:
    """The content of one spot of the picture in one frame.

    Attributes:
        character: name of its character; empty for none.
        body: the body that the character turns to, or that drives it; None for no body.
        ring: filled fraction of the progress ring, 0..1.
        driven: the character in the pose that a body or a take gives it; None while it waits.
        source: what moves the character, see :meth:`CharacterFigure.show`.
        others: further characters of a take.
    """

    character: str
    body: Body | None = None
    ring: float = 0.0
    driven: SceneCharacter | None = None
    source: str = "waits"
    others: tuple[SceneCharacter, ...] = ()


class RecordedPerformance(Protocol):
    """A recorded performance in progress."""

    character: str

    def advance(self, seconds: float) -> SpotContent | None:
        """Advances the performance. Returns what to show, or None at its end."""
        ...


class VisitPerformance:
    """A recorded body that walks to the spot, waits until the progress ring is full, and controls a
    character.

    Args:
        frames: the bodies, with the spot at the origin of the floor.
        actor: the character with its solver. No body may control it yet.
        parts: the body parts that control the character.
        place: point (x, z) in metres of the spot in the picture.
        radius: its radius in metres.
        dwell: seconds until the progress ring is full.
    """

    def __init__(
        self,
        frames: Sequence[BodyFrame],
        actor: EmbeddedActor,
        parts: str,
        place: Place,
        radius: float,
        dwell: float,
    ) -> None:
        self.character = actor.character.id
        self._frames, self._actor, self._parts = frames, actor, parts
        self._times = np.array([frame.time_ns for frame in frames]) / NS_PER_S
        self._times -= self._times[0]
        self._offset = np.array([place[0], 0.0, place[1]])
        self._place, self._radius, self._dwell = place, radius, dwell
        self._now = self._ring = 0.0
        self._number = random.randrange(1 << 16)  # Distinguishes this visit from the previous one.

    def advance(self, seconds: float) -> SpotContent | None:
        """Advances the visit. Returns the content of the spot, or None at the end of the visit."""
        step = min(seconds, _MAX_STEP_S)
        self._now += step
        if self._now > self._times[-1] + _RELEASE_S:
            return None
        body = self._body_at(self._now)
        if body is None:
            self._release()
            return SpotContent(self.character, None, 0.0, self._perform([]), f"visit {self._number}")
        if not self._actor.holds:
            hips = body.joints[Joint.HIP_CENTER, [0, 2]]
            if math.dist(hips, self._place) <= self._radius:
                self._ring = min(self._ring + step / self._dwell, 1.0)
            if self._ring < 1.0:
                return SpotContent(self.character, body, self._ring)
            self._actor.possess(body, self._parts)
        return SpotContent(self.character, body, 0.0, self._perform([body]), f"visit {self._number}")

    def _perform(self, bodies: list[Body]) -> SceneCharacter:
        pose = self._actor.perform(bodies, round(self._now * NS_PER_S))
        return SceneCharacter(self._actor.character, pose)

    def _release(self) -> None:
        if self._actor.holds:
            self._actor.release()

    def _body_at(self, second: float) -> Body | None:
        """Returns the body at a time in seconds, moved to the spot, or None after the last frame."""
        if second > self._times[-1]:
            return None
        after = int(np.searchsorted(self._times, second, side="right"))
        first, last = self._frames[after - 1], self._frames[min(after, len(self._frames) - 1)]
        span = max(self._times[min(after, len(self._times) - 1)] - self._times[after - 1], 1e-6)
        fraction = float(np.clip((second - self._times[after - 1]) / span, 0.0, 1.0))
        bodies = blend_bodies(tuple(first.bodies), tuple(last.bodies), fraction)
        return replace(bodies[0], joints=bodies[0].joints + self._offset) if bodies else None


class TakePerformance:
    """A recorded take with its own characters.

    Args:
        path: the take.
        place: point (x, z) in metres of the spot. The centre of the take's characters is moved there.

    Raises:
        InputError: if the take cannot be played.
    """

    def __init__(self, path: Path, place: Place) -> None:
        self._live = LiveStage(TakeFeed(path), Document(Timeline(bounded=False)), take=path.name)
        self._live.playhead.loop = False
        self._place, self._name = place, path.name
        self._offset: Float32 | None = None
        self.character = ""
        self._shown = 0.0

    def advance(self, seconds: float) -> SpotContent | None:
        """Advances the take. Returns the content of the spot, or None at the end of the take."""
        self._live.advance(seconds)
        self._shown += seconds
        timeline, actors = self._live.document.timeline, self._live.scene.actors
        has_ended = self._live.document.edge.phase == "ended"
        if has_ended and (not actors or self._live.playhead.time_ns >= timeline.end_ns):
            self._live.close()
            return None
        if not actors:
            return SpotContent("")
        offset = self._offset
        if offset is None:
            middle = np.concatenate([actor.extent for actor in actors]).mean(0)
            offset = np.array([self._place[0] - middle[0], 0.0, self._place[1] - middle[2]], np.float32)
            self._offset = offset
        moved = [_offset_character(actor, offset) for actor in actors]
        self.character = moved[0].character.id
        return SpotContent(self.character, None, 0.0, moved[0], f"take {self._name}", tuple(moved[1:]))


def _offset_character(actor: SceneCharacter, offset: Float32) -> SceneCharacter:
    """Returns a character moved by (3,) metres."""
    pose = replace(actor.pose, positions=actor.pose.positions + offset)
    vertices = None if actor.vertices is None else actor.vertices + offset
    return replace(actor, pose=pose, vertices=vertices, cues=None)


class PerformanceCycle:
    """Plays the performances of a kiosk in turn, endlessly.

    Characters are prepared in the background, because fitting a person into a mesh takes seconds.

    Args:
        paths: recordings of bodies, or takes. If empty, the recordings in the package are used.
        parts: the body parts that control each character, by its name.
        place: point (x, z) of the spot in metres.
        radius: its radius in metres.
        dwell: seconds until the progress ring is full.
        order: the characters, in the order in which they appear.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        parts: Mapping[str, str],
        place: Place,
        radius: float,
        dwell: float,
        order: Sequence[str],
    ) -> None:
        self.problems: list[str] = []
        self._parts, self._place, self._radius, self._dwell = parts, place, radius, dwell
        self._order = list(order)
        self._makers = self._list_recordings(paths or list_shipped_visits())
        self._background = ThreadPoolExecutor(1, "kiosk performances")
        self._prepared: dict[str, tuple[Character, Future[EmbeddedActor]]] = {}
        self._characters: Mapping[str, Character] = {}
        self._current: RecordedPerformance | None = None
        self._pause_s = 0.0
        self._turn = 0

    @property
    def character(self) -> str:
        """Returns the name of the character that performs now or next."""
        playing = self._current.character if self._current is not None else ""
        names = [name for name in self._order if name in self._characters]
        return playing or (names[self._turn % len(names)] if names else "")

    def update_characters(self, characters: Mapping[str, Character]) -> None:
        """Updates the characters of the stage. Starts to prepare new ones in the background."""
        self._characters = characters
        for name, character in characters.items():
            old_character = self._prepared.get(name)
            if character.kind == "graph" and (old_character is None or old_character[0] is not character):
                future = self._background.submit(_prepare_actor, character)
                self._prepared[name] = character, future

    def advance(self, seconds: float) -> SpotContent:
        """Advances the current performance, or starts the next. Returns the content of the spot."""
        if self._current is not None:
            act = self._current.advance(seconds)
            if act is not None:
                return act
            self._current, self._pause_s = None, _PAUSE_S
            self._turn += 1
        self._pause_s -= seconds
        if self._pause_s <= 0.0:
            self._current = self._start()
        return SpotContent(self.character)

    def stop(self) -> None:
        """Ends the current performance, because a visitor has come."""
        if self._current is not None:
            self._turn += 1
        self._current, self._pause_s = None, _PAUSE_S

    def close(self) -> None:
        """Ends the work in the background."""
        self._background.shutdown(wait=False, cancel_futures=True)

    def _start(self) -> RecordedPerformance | None:
        """Returns the next performance, or None if none can begin yet."""
        for step in range(len(self._makers)):
            performance = self._makers[(self._turn + step) % len(self._makers)]()
            if performance is not None:
                return performance
        return None

    def _list_recordings(self, paths: Sequence[Path]) -> list[Callable[[], RecordedPerformance | None]]:
        """Returns a function for each readable recording. Each function starts the performance."""
        makers: list[Callable[[], RecordedPerformance | None]] = []
        for path in paths:
            try:
                makers.append(self._read_one(path))
            except EnlivenError as error:
                self.problems.append(str(error))
                log.warning("%s", error)
        return makers

    def _read_one(self, path: Path) -> Callable[[], RecordedPerformance | None]:
        recording = Recording(path)
        if {"pose", "character"} <= set(recording.info.topics):
            return lambda: self._start_take(path)
        if BODIES_TOPIC not in recording.info.topics:
            raise InputError(
                "the recording contains neither bodies nor a performance",
                where=str(path),
                remedy="Record a visit: enliven edge --record FILE.mcap",
            )
        frames = [frame for frame in recording.frames() if isinstance(frame, BodyFrame)]
        if len(frames) < 2:
            raise InputError(
                "the recording contains fewer than two frames with bodies",
                where=str(path),
                remedy="Record a longer visit.",
            )
        return lambda: self._start_visit(frames)

    def _start_take(self, path: Path) -> RecordedPerformance | None:
        try:
            return TakePerformance(path, self._place)
        except EnlivenError as error:
            log.warning("%s", error)
            return None

    def _start_visit(self, frames: Sequence[BodyFrame]) -> RecordedPerformance | None:
        """Returns a visit to the next character, or None while that character is being prepared."""
        prepared = self._prepared.get(self.character)
        if prepared is None or not prepared[1].done():
            return None
        try:
            rehearsed = prepared[1].result()
        except EnlivenError as error:
            log.warning("%s", error)
            return None
        actor = EmbeddedActor(
            rehearsed.character, rehearsed.graph, rehearsed.settings, person=lambda: rehearsed.likeness
        )
        parts = self._parts.get(self.character, "all")
        return VisitPerformance(frames, actor, parts, self._place, self._radius, self._dwell)


def list_shipped_visits() -> list[Path]:
    """Returns the paths of the recorded visits in the package."""
    folder = Path(str(resources.files("enliven_viewer.kiosk") / "visits"))
    return sorted(folder.glob("*.mcap"))


def _prepare_actor(character: Character) -> EmbeddedActor:
    """Fits a person into the mesh of a character and compiles its solver. Returns both as an actor."""
    actor = EmbeddedActor(character, graph_from_character(character))
    actor.warm_up()
    return actor
