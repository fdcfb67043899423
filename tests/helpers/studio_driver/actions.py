"""Actions of a session. Each one runs frame by frame, as with a mouse and a keyboard."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from enliven_viewer.studio.viewport.overlay import Point
from enliven_viewer.studio.workspace.workspace import Workspace
from studio_driver.places import Place, SessionStage, Widget, where

STEP = 1 / 24
"""Time between two frames, seconds."""


@dataclass(frozen=True)
class Say:
    """Shows a caption until the next one. An empty text hides it."""

    text: str


@dataclass(frozen=True)
class Open:
    """Opens a file."""

    path: Path


@dataclass(frozen=True)
class Key:
    """Presses a key, such as "c" or "ctrl+z"."""

    key: str


@dataclass(frozen=True)
class Click:
    """Moves to a place and clicks."""

    place: Place
    shift: bool = False


@dataclass(frozen=True)
class Drag:
    """Presses at the first place, moves over the others, and releases at the last.

    Attributes:
        button: 0 left, 1 right (turns the view), 2 middle.
        shift: True to hold Shift.
        seconds: duration of the drag.
    """

    places: tuple[Place, ...]
    seconds: float = 0.9
    button: int = 0
    shift: bool = False


@dataclass(frozen=True)
class Name:
    """Names the selected shape by typing in its field."""

    name: str


@dataclass(frozen=True)
class Wait:
    """Lets time pass."""

    seconds: float


@dataclass(frozen=True)
class Do:
    """Calls a function with the workspace, for actions that have no class."""

    command: Callable[[Workspace], object]


Action = Say | Open | Key | Click | Drag | Name | Wait | Do


def steps(actions: Iterable[Action], stage: SessionStage) -> Iterator[None]:
    """Runs the actions; each step is one frame."""
    for action in actions:
        yield from _steps_of(action, stage)


def play(actions: Iterable[Action], stage: SessionStage, each: Callable[[], object] | None = None) -> None:
    """Runs all actions without a window; ``each`` is called after every step of the studio's clock."""
    for _ in steps(actions, stage):
        stage.workspace.editor.advance(STEP)
        if each is not None:
            each()


def _steps_of(action: Action, stage: SessionStage) -> Iterator[None]:
    workspace = stage.workspace
    if isinstance(action, Say):
        workspace.caption = action.text
    elif isinstance(action, Open):
        workspace.open(action.path)
    elif isinstance(action, Key):
        workspace.pressed = action.key
        stage.key(action.key)
        yield from _pause(0.25, stage)
        workspace.pressed = ""
    elif isinstance(action, Click) and isinstance(action.place, Widget) and stage.activate(action.place.name):
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
        action.command(workspace)
        yield


def _pause(seconds: float, stage: SessionStage) -> Iterator[None]:
    for _ in range(max(round(seconds / STEP), 1)):
        yield


def _glide(stage: SessionStage, place: Place, seconds: float) -> Iterator[None]:
    """Moves the pointer to a place with ease-in and ease-out. The place may itself move."""
    start, count = np.array(stage.at), max(round(seconds / STEP), 1)
    for k in range(1, count + 1):
        share = k / count
        eased = share * share * (3 - 2 * share)
        end = np.array(where(place, stage))
        at = start + eased * (end - start)
        stage.move((float(at[0]), float(at[1])))
        yield


def _drag(action: Drag, stage: SessionStage) -> Iterator[None]:
    yield from _glide(stage, action.places[0], stage.pace)
    stage.shift(action.shift)
    yield
    stage.button(action.button, True)
    yield
    # The places are looked up before anything moves, since the dragged object may be one of them.
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


def _name(name: str, stage: SessionStage) -> Iterator[None]:
    """Types into the name field. Without a window, it renames the shape."""
    if stage.rename(name):
        yield
        return
    yield from _steps_of(Click(Widget("name")), stage)
    for letter in name:
        stage.write(letter)
        yield
    stage.key("enter")
    yield from _pause(0.2, stage)


def _along(points: np.ndarray, share: float) -> Point:
    """Returns the point at a fraction of a polyline's length, (P, 2)."""
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    at = share * lengths[-1]
    return float(np.interp(at, lengths, points[:, 0])), float(np.interp(at, lengths, points[:, 1]))
