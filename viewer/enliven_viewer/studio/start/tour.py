"""A tour of three minutes: each step says what to do, sees it done, and goes on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from enliven_viewer.studio.actions import ActionTable
from enliven_viewer.studio.editor import Editor

_TURNED = 0.97
"""Cosine of about 14 degrees: a view that was turned by more was turned on purpose."""
_STAYS = 1.2
"""Seconds that a step stays after its deed, with a tick, before the next one is shown."""


class Saved(Protocol):
    """The file of the project."""

    @property
    def named(self) -> bool:
        """Whether it has a file."""

    @property
    def dirty(self) -> bool:
        """Whether something is not saved."""


@dataclass(frozen=True)
class Toured:
    """What the steps of the tour look at."""

    editor: Editor
    actions: ActionTable
    store: Saved

    @property
    def characters(self) -> int:
        """How many characters there are."""
        return len(self.editor.project.characters)

    @property
    def handles(self) -> int:
        """How many joints and control points there are."""
        return sum(len(one.handles) for one in self.editor.project.characters.values())

    @property
    def layers(self) -> int:
        """How many layers play."""
        return sum(len(one.playing) for one in self.editor.project.characters.values())

    @property
    def merges(self) -> int:
        """How often two characters were made one."""
        return sum(name.startswith("merge") for name in self.editor.history.names)


@dataclass(frozen=True)
class TourStep:
    """A step of the tour.

    Attributes:
        title: what is to be done, in a few words.
        text: how, with the keys as ``{id of an action}``.
        look: what is looked at when the step begins, and again in every picture.
        done: whether the first and the last of these say that it was done.
    """

    title: str
    text: str
    look: Callable[[Toured], Any]
    done: Callable[[Any, Any], bool]


def _more(before: int, now: int) -> bool:
    return now > before


TOUR = (
    TourStep(
        "Draw a tentacle",
        "Press {tool.sketch}. Draw a long closed outline in the picture, and let go where you began.",
        lambda t: t.characters,
        _more,
    ),
    TourStep(
        "Look around it",
        "Drag in the picture with the right button. The wheel goes closer; {view.all} shows all.",
        lambda t: t.editor.lens.forward,
        lambda before, now: float(np.dot(before, now)) < _TURNED,
    ),
    TourStep(
        "Let it bend",
        "Press {tool.insert} and click on its bone: a node appears there. More nodes bend more softly.",
        lambda t: t.handles,
        _more,
    ),
    TourStep(
        "Give it a motion",
        "Under Takes at the right, click wave. In the picture of the take, click the two ends of its chain; "
        "then click the same two ends on your tentacle.",
        lambda t: t.layers,
        _more,
    ),
    TourStep(
        "Watch it move",
        "Press {view.play}. Press it again to stop; drag on the timeline to go to any moment.",
        lambda t: t.editor.playing,
        lambda before, now: bool(now),
    ),
    TourStep(
        "Make a second one",
        "Press {tool.choose}, click your tentacle, and press {edit.duplicate}. The copy moves as well.",
        lambda t: t.characters,
        _more,
    ),
    TourStep(
        "Make one of the two",
        "Press {tool.carry} and drag the red root of the copy onto a node of the first. Both go on moving.",
        lambda t: t.merges,
        _more,
    ),
    TourStep(
        "Change your mind",
        "Press {edit.undo}: nothing is ever lost. {edit.history} lists all steps, and a click goes there.",
        lambda t: t.editor.history.at,
        lambda before, now: now < before,
    ),
    TourStep(
        "Find anything",
        "Press {help.palette}, type some letters of what you want, such as “larger”, and press Enter.",
        lambda t: t.actions.recent[:2],
        lambda before, now: now != before and now[1:] == ["help.palette"],
    ),
    TourStep(
        "Keep it",
        "Press {file.save}, type a name, and press Enter.",
        lambda t: t.store.named and not t.store.dirty,
        lambda before, now: bool(now),
    ),
)
"""The steps, in their order; each can be done in a quarter of a minute."""


class Tour:
    """The tour as far as it has come.

    Attributes:
        number: of the step that is to be done; that of no step once all are done.
        ticked: seconds for which the step that was just done still stays.
    """

    def __init__(self, toured: Toured) -> None:
        self._toured = toured
        self.number, self.ticked = 0, 0.0
        self._before = TOUR[0].look(toured)

    @property
    def step(self) -> TourStep | None:
        """The step that is to be done; None once all are."""
        return TOUR[self.number] if self.number < len(TOUR) else None

    @property
    def text(self) -> str:
        """How to do it, with the keys that the artist has."""
        actions = self._toured.actions
        keys = {action.id: actions.shown_key(action) or action.label for action in actions}
        said = self.step.text if self.step is not None else ""
        for name, key in keys.items():
            said = said.replace(f"{{{name}}}", key)
        return said

    def watch(self, seconds: float) -> None:
        """Look whether the step was done; to be called once a picture, so long after the one before."""
        if self.step is None:
            return
        if self.ticked > 0.0:
            self.ticked -= seconds
            if self.ticked <= 0.0:
                self.skip()
        elif self._is_done(self.step):
            self.ticked = _STAYS

    def skip(self) -> None:
        """Go on with the next step."""
        self.number, self.ticked = self.number + 1, 0.0
        if self.step is not None:
            self._before = self.step.look(self._toured)

    def _is_done(self, step: TourStep) -> bool:
        return step.done(self._before, step.look(self._toured))
