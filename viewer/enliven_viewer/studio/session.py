"""Sessions: what an artist does, as a list of actions that drive the studio's own tools.

    session = [Key("m"), Click(Widget("takes")), Click(Joint("tentacle", 0)), Drag(...), Wait(1.0)]
    play(session, DeskStage(desk))            # without a window, for tests
    film(session, desk, path)                 # in the real window, into a film: see filming.py

Places are looked up when they are needed: a joint is clicked where it then is on the screen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from enliven.errors import InputError
from enliven_viewer.studio.desk import Desk
from enliven_viewer.studio.naming import renamed
from enliven_viewer.studio.overlay import Point
from enliven_viewer.studio.places import places_in
from enliven_viewer.studio.source_view import SourceView
from enliven_viewer.studio.tools.map import Map

STEP = 1 / 24
"""Seconds from one picture to the next."""


@dataclass(frozen=True)
class Joint:
    """A joint of a shape, by number or name."""

    shape: str
    joint: int | str = 0


@dataclass(frozen=True)
class OnBone:
    """A place on the bone that ends at a joint: 0 at its parent, 1 at the joint."""

    shape: str
    joint: int | str
    along: float


@dataclass(frozen=True)
class Spot:
    """A place in the world, metres."""

    x: float
    y: float
    z: float = 0.0


@dataclass(frozen=True)
class Near:
    """Pixels to the right of and below another place."""

    place: Place
    right: float = 0.0
    down: float = 0.0


@dataclass(frozen=True)
class Pixel:
    """A place in the viewport, as shares of its width and height from the top left."""

    across: float
    down: float


@dataclass(frozen=True)
class SourceJoint:
    """A joint of the take in the view of sources."""

    joint: int


@dataclass(frozen=True)
class Widget:
    """A widget by the name that its panel gives it; needs a window."""

    name: str


@dataclass(frozen=True)
class OnTimeline:
    """A time on the ruler, seconds; or with ``lane`` at that time in a lane, counted from the top."""

    time: float
    lane: int | None = None


Place = Joint | OnBone | Spot | Near | Pixel | SourceJoint | Widget | OnTimeline


@dataclass(frozen=True)
class Say:
    """A caption from now on; empty for none."""

    text: str


@dataclass(frozen=True)
class Open:
    """Open a file."""

    path: Path


@dataclass(frozen=True)
class Key:
    """Press a key, such as "c" or "ctrl+z"."""

    key: str


@dataclass(frozen=True)
class Click:
    """Move to a place and click."""

    place: Place
    shift: bool = False


@dataclass(frozen=True)
class Drag:
    """Press at the first place, move over the others, let go at the last.

    Attributes:
        button: 0 left, 1 right (turns the view), 2 middle.
        shift: whether Shift is held.
        seconds: that the way takes.
    """

    places: tuple[Place, ...]
    seconds: float = 0.9
    button: int = 0
    shift: bool = False


@dataclass(frozen=True)
class Name:
    """Give the chosen shape a name, in its field."""

    name: str


@dataclass(frozen=True)
class Wait:
    """Let time pass."""

    seconds: float


@dataclass(frozen=True)
class Do:
    """Anything else that is done with the desk."""

    deed: Callable[[Desk], object]


Action = Say | Open | Key | Click | Drag | Name | Wait | Do


class Stage(Protocol):
    """Where a session's input goes; places are pixels of its own."""

    desk: Desk
    at: Point
    pace: float

    def move(self, at: Point) -> None:
        """Move the pointer."""

    def button(self, button: int, down: bool) -> None:
        """Press or let go of a button."""

    def shift(self, down: bool) -> None:
        """Press or let go of Shift."""

    def key(self, key: str) -> None:
        """Press a key and let go of it."""

    def write(self, text: str) -> None:
        """Type text into the field that has the focus."""

    def viewport(self) -> Point:
        """Where the viewport's top left is."""

    def source(self) -> Point:
        """Where the view of sources' top left is."""

    def timeline(self) -> Point:
        """Where the timeline's top left is."""

    def widget(self, name: str) -> Point:
        """Where the middle of a widget is."""


def steps(actions: Sequence[Action], stage: Stage) -> Iterator[None]:
    """Does the actions; each step is one picture."""
    for action in actions:
        yield from _steps_of(action, stage)


def play(actions: Sequence[Action], stage: DeskStage, each: Callable[[], object] | None = None) -> None:
    """Do everything without a window; ``each`` is called after every step of the studio's clock."""
    for _ in steps(actions, stage):
        stage.desk.editor.advance(STEP)
        if each is not None:
            each()


def _steps_of(action: Action, stage: Stage) -> Iterator[None]:
    desk = stage.desk
    if isinstance(action, Say):
        desk.caption = action.text
    elif isinstance(action, Open):
        desk.open(action.path)
    elif isinstance(action, Key):
        desk.pressed = action.key
        stage.key(action.key)
        yield from _pause(0.25, stage)
        desk.pressed = ""
    elif isinstance(action, Click) and isinstance(action.place, Widget) and isinstance(stage, DeskStage):
        stage.activate(action.place.name)
        yield
    elif isinstance(action, Click):
        yield from _glide(stage, action.place, stage.pace)
        stage.shift(action.shift)
        yield
        stage.button(0, True)
        yield
        yield
        stage.button(0, False)
        yield
        stage.shift(False)
        yield from _pause(0.2, stage)
    elif isinstance(action, Drag):
        yield from _drag(action, stage)
    elif isinstance(action, Name):
        yield from _name(action.name, stage)
    elif isinstance(action, Wait):
        yield from _pause(action.seconds, stage)
    else:
        action.deed(desk)
        yield


def _pause(seconds: float, stage: Stage) -> Iterator[None]:
    for _ in range(max(round(seconds / STEP), 1)):
        yield


def _glide(stage: Stage, place: Place, seconds: float) -> Iterator[None]:
    """Move the pointer to a place that may move itself, slow at both ends."""
    start, count = np.array(stage.at), max(round(seconds / STEP), 1)
    for k in range(1, count + 1):
        share = k / count
        eased = share * share * (3 - 2 * share)
        end = np.array(where(place, stage))
        at = start + eased * (end - start)
        stage.move((float(at[0]), float(at[1])))
        yield


def _drag(action: Drag, stage: Stage) -> Iterator[None]:
    yield from _glide(stage, action.places[0], stage.pace)
    stage.shift(action.shift)
    yield
    stage.button(action.button, True)
    yield
    # Looked up before anything moves: what is dragged may itself be one of the places.
    ways = [where(place, stage) for place in action.places[1:]]
    points = np.array([stage.at, *ways])
    count = max(round(action.seconds / STEP), len(points))
    for k in range(1, count + 1):
        share = k / count
        eased = share * share * (3 - 2 * share) if len(points) == 2 else share
        stage.move(_along(points, eased))
        yield
    yield from _pause(0.15, stage)
    stage.button(action.button, False)
    yield
    stage.shift(False)
    yield from _pause(0.2, stage)


def _name(name: str, stage: Stage) -> Iterator[None]:
    """Type into the field of the name; without a window there is none, and the shape is renamed."""
    if isinstance(stage, DeskStage):
        editor = stage.desk.editor
        before = editor.selection.shape or ""
        if editor.edit("rename", lambda project: renamed(project, before, name)):
            editor.select(shape=name)
        yield
        return
    yield from _steps_of(Click(Widget("name")), stage)
    for letter in name:
        stage.write(letter)
        yield
    stage.key("enter")
    yield from _pause(0.2, stage)


def _along(points: np.ndarray, share: float) -> Point:
    """The place at a share of a polyline's length, (P, 2)."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = share * lengths[-1]
    return float(np.interp(at, lengths, points[:, 0])), float(np.interp(at, lengths, points[:, 1]))


def where(place: Place, stage: Stage) -> Point:
    """The pixel of a place on a stage, as things stand.

    Raises:
        InputError: where it is not on the screen.
    """
    editor = stage.desk.editor
    if isinstance(place, Near):
        x, y = where(place.place, stage)
        return x + place.right, y + place.down
    if isinstance(place, Widget):
        return stage.widget(place.name)
    if isinstance(place, OnTimeline):
        return _on_timeline(place, stage)
    if isinstance(place, SourceJoint):
        source = source_of(stage.desk)
        stance = source.stance()
        if stance is None:
            raise InputError("no take is shown", where="session")
        pixel = source.lens.project(stance.joints)[0][place.joint]
        return _shifted(stage.source(), pixel)
    if isinstance(place, Pixel):
        return _shifted(stage.viewport(), np.array([place.across, place.down]) * editor.size)
    pixel = editor.lens.project(_in_world(place, stage.desk)[None])[0][0]
    if not ((pixel >= 0) & (pixel < editor.size)).all():
        raise InputError(f"{place} is outside the picture", where="session", mend='Frame it: Key("f").')
    return _shifted(stage.viewport(), pixel)


def source_of(desk: Desk) -> SourceView:
    """The view of sources."""
    tool = desk.hand.tools["map"]
    assert isinstance(tool, Map)
    return tool.source


def _in_world(place: Joint | OnBone | Spot, desk: Desk) -> np.ndarray:
    """(3,) metres."""
    if isinstance(place, Spot):
        return np.array([place.x, place.y, place.z])
    stance = desk.editor.stance(place.shape)
    skeleton = stance.shape.skeleton
    joint = skeleton.index(place.joint) if isinstance(place.joint, str) else place.joint
    if isinstance(place, Joint):
        return stance.joints[joint]
    start = stance.joints[skeleton.parents[joint]]
    return np.asarray(start + place.along * (stance.joints[joint] - start))


def _on_timeline(place: OnTimeline, stage: Stage) -> Point:
    layout = stage.desk.timeline.layout
    y = 8.0 if place.lane is None else layout.bars()[place.lane].top + 10.0
    return _shifted(stage.timeline(), np.array([layout.x(place.time), y]))


def _shifted(corner: Point, at: np.ndarray) -> Point:
    if not np.isfinite(at).all():
        raise InputError("a place is behind the camera", where="session")
    return corner[0] + float(at[0]), corner[1] + float(at[1])


_AREA = 100_000.0
"""Pixels between the areas of a stage without a window: each is far from the others."""


class DeskStage:
    """A stage without a window: the viewport, the view of sources and the timeline, each far from the others.

    Args:
        pace: seconds that the pointer takes to a place.
    """

    pace = STEP

    def __init__(self, desk: Desk) -> None:
        self.desk, self.at = desk, (0.0, 0.0)
        area = places_in(desk.editor.settings.width, desk.editor.settings.height).viewport
        desk.editor.size = (area.width, area.height)
        desk.editor.frame_all(at_once=True)
        self._shift = False
        self._in = ""

    def move(self, at: Point) -> None:
        self.at = at = float(math.floor(at[0])), float(math.floor(at[1]))  # whole pixels, as a mouse has
        area = self._in or self._area()
        if area == "source":
            source_of(self.desk).move((at[0] - _AREA, at[1]))
        elif area == "timeline":
            self.desk.timeline.drag(at[0] - 2 * _AREA)
        else:
            self.desk.hand.move(at, shift=self._shift)

    def button(self, button: int, down: bool) -> None:
        area, x = self._in or self._area(), self.at[0]
        self._in = area if down else ""
        if area == "source":
            source = source_of(self.desk)
            source.press((x - _AREA, self.at[1])) if down else source.release()
        elif area == "timeline":
            hand = self.desk.timeline
            hand.press(x - 2 * _AREA, self.at[1]) if down else hand.release(x - 2 * _AREA)
        elif down:
            self.desk.hand.press(self.at, button, shift=self._shift)
        else:
            self.desk.hand.release(self.at, button, shift=self._shift)

    def shift(self, down: bool) -> None:
        self._shift = down

    def key(self, key: str) -> None:
        self.desk.hand.key(key)

    def write(self, text: str) -> None:
        """There is no field without a window."""

    def viewport(self) -> Point:
        return 0.0, 0.0

    def source(self) -> Point:
        return _AREA, 0.0

    def timeline(self) -> Point:
        return 2 * _AREA, 0.0

    def widget(self, name: str) -> Point:
        raise InputError(f"there is no window, so {name!r} has no place", where="session", mend="Use a key.")

    def activate(self, name: str) -> None:
        """What a click on a widget does, for those that a session needs.

        Raises:
            InputError: for one that it does not know.
        """
        kind, _, rest = name.partition(" ")
        mapping = self.desk.hand.tools["map"]
        assert isinstance(mapping, Map)
        if kind == "tool":
            self.desk.hand.take(rest)
        elif kind == "takes":
            pass  # a list that opens
        elif kind in ("take", "pick"):
            self.desk.hand.take("map")
            mapping.source.show(rest)
        elif kind == "loop":
            mapping.loop = not mapping.loop
        elif kind == "find":
            mapping.rank()
        elif kind == "whole":
            mapping.map_whole()
        elif kind == "match":
            mapping.accept(mapping.offered[int(rest)])
            mapping.offered = []
        else:
            raise InputError(f"there is no window, so {name!r} cannot be clicked", where="session")

    def _area(self) -> str:
        return ("viewport", "source", "timeline")[min(int(self.at[0] // (_AREA / 2) + 1) // 2, 2)]
