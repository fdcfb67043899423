"""The tour as far as it has come: it sees each step done, goes on, goes back, and can be left and resumed."""

from __future__ import annotations

import math

from enliven_viewer.studio.start.demonstration import Demonstration
from enliven_viewer.studio.start.legs import chair_in_picture
from enliven_viewer.studio.start.steps import ENDING, TOUR, TourPart, TourStep
from enliven_viewer.studio.start.target import DrawnWidgets, Rectangle, Target
from enliven_viewer.studio.start.toured import Desk, Toured
from enliven_viewer.studio.viewport import Point

_STAYS_S = 1.2
"""Seconds that a step stays after it was done, with a tick, before the next one is shown."""
_AGAIN_S = 6.0
"""Seconds without an effect after which the tour shows a part once more: the stage may have been busy."""
_NEAR = 30.0
"""Pixels around what is meant in the picture within which the pointer makes a dancing chair hold still."""
_MISSING_S = 2.0
"""Seconds for which a step lacks what it needs before the tour goes back: a dancer is lost for a moment."""


class Tour:
    """The tour.

    Args:
        desk: the workspace.
        widgets: where widgets are drawn.
        number: of the step to resume at; the tour begins at an earlier one if that lacks what it needs.

    Attributes:
        number: of the step that is to be done; the count of the steps once all are.
        ticked: seconds for which the step that was just done still stays.
        reviewing: whether a step is looked at again that was done before; it stays until *Next*.
        shows: whether the tour does the step for the artist; demonstration: its hand, while that moves.
        target: where the tour points.
        card: where the card was drawn last, in the window's pixels; card_key: what was said then.
    """

    def __init__(self, desk: Desk, widgets: DrawnWidgets, number: int = 0) -> None:
        self._toured, self._widgets = Toured(desk), widgets
        self.number, self.ticked, self.reviewing = min(number, len(TOUR) - 1), 0.0, False
        self.shows = False
        self.demonstration: Demonstration | None = None
        self.target = Target()
        self.card: Point | None = None
        self.card_key: tuple[object, ...] = ()
        self._shown: TourPart | None = None
        self._rested, self._hand = 0.0, (0.0, 0.0)
        self._missing = 0.0
        self._before = self._toured.counts
        self._is_new, self._holds_still = True, False
        while self.number and not TOUR[self.number].ready(self._toured):
            self.number -= 1

    @property
    def step(self) -> TourStep | None:
        """Returns the step that is to be done; None once all are."""
        return TOUR[self.number] if self.number < len(TOUR) else None

    @property
    def part(self) -> TourPart | None:
        """Returns the part of the step that is to be done; None once it is done, or all are."""
        step = self.step
        return None if step is None or self.ticked > 0.0 else step.part(self._toured, self._before)

    @property
    def title(self) -> str:
        """Returns the subject of the step, in a few words."""
        return ENDING[0] if self.step is None else self.step.title

    @property
    def text(self) -> str:
        """Returns the thing to do now: one sentence; empty while a tick is shown."""
        if self.step is None:
            return ENDING[1]
        part = self.part
        return "" if part is None else part.text

    @property
    def wants_samples(self) -> bool:
        """Returns True if the start page has to be shown, since a sample is to be clicked on it."""
        return any(name.startswith("do ") for name in self.target.widgets)

    @property
    def moves(self) -> bool:
        """Returns True if something of it moves by itself, so that the window must not rest."""
        return self.shows or self.ticked > 0.0

    def outline(self, origin: Point) -> Rectangle | None:
        """Returns where what is meant is now, in the window's pixels; None if it cannot be seen.

        Args:
            origin: the top left of the picture, in the window's pixels.
        """
        if self.target.box is not None:
            left, top, right, bottom = self.target.box
            return left + origin[0], top + origin[1], right + origin[0], bottom + origin[1]
        found = self._widgets.find(self.target.widgets)
        return None if found is None else found[1]

    def covered(self, origin: Point) -> Rectangle | None:
        """Returns where the chair is in the window's pixels, so that nothing is put over it; None without
        one.
        """
        box = chair_in_picture(self._toured.desk.editor, self._toured.extent).box
        if box is None:
            return None
        return box[0] + origin[0], box[1] + origin[1], box[2] + origin[0], box[3] + origin[1]

    def watch(self, seconds: float, origin: Point = (0.0, 0.0)) -> None:
        """Looks whether the step was done; to be called once per frame, so long after the one before."""
        step = self.step
        if step is None:
            self.target = Target()
            self._widgets.want(())
            return
        if self.ticked > 0.0:
            self._tick(seconds)
        elif not self.reviewing:
            if self._is_done(step):
                self.ticked = _STAYS_S
                self._stop_showing()
            else:
                self._look_for_needs(step, seconds)
        if self._is_new and self.step is not None:
            self._is_new = False
            self.step.begin(self._toured)
        part = self.part
        self.target = Target() if part is None else part.target(self._toured)
        self._widgets.want(self.target.widgets)
        self._hold_still()
        self._show_on(seconds, origin)

    def skip(self) -> None:
        """Goes on with the next step that has what it needs."""
        self._go(self.number + 1)
        while self.number < len(TOUR) - 1 and not TOUR[self.number].ready(self._toured):
            self._go(self.number + 1)

    def back(self) -> None:
        """Looks at the step before; if it was done already it stays until :meth:`skip`."""
        self._go(max(self.number - 1, 0))
        step = self.step
        self.reviewing = step is not None and self._is_done(step)

    def show(self, start: Point) -> None:
        """Lets the tour do the step; the hand begins at a pixel of the window."""
        if self.part is not None and not self.shows:
            self.shows, self._hand, self._shown = True, start, None

    def _hold_still(self) -> None:
        """Lets what plays stand still while the pointer is near: a dancing leg is hard to hit."""
        editor, hands = self._toured.desk.editor, self._toured.desk.input
        if hands.busy or self.demonstration is not None:
            return
        path, box = self.target.path, self.target.box
        near = bool(path) and box is not None and _is_near(hands.at, box, path[0])
        if near and editor.playing:
            editor.playing, self._holds_still = False, True
        elif not near:
            self._let_play()

    def _let_play(self) -> None:
        """Lets what was made to stand still play on."""
        if self._holds_still:
            self._toured.desk.editor.playing, self._holds_still = True, False

    def leave(self) -> None:
        """Restores the studio: playing, pointer and widgets."""
        self._stop_showing()
        self._let_play()
        self._widgets.want(())

    def _go(self, number: int) -> None:
        self._stop_showing()
        self.number, self.ticked, self.reviewing, self._missing = number, 0.0, False, 0.0
        self._before, self._is_new = self._toured.counts, True

    def _tick(self, seconds: float) -> None:
        self.ticked -= seconds
        if self.ticked <= 0.0:
            self._go(self.number + 1)

    def _is_done(self, step: TourStep) -> bool:
        return step.part(self._toured, self._before) is None

    def _look_for_needs(self, step: TourStep, seconds: float) -> None:
        """Goes back where a step has lacked for a while what it needs."""
        self._missing = 0.0 if step.ready(self._toured) else self._missing + seconds
        if self._missing > _MISSING_S:
            number = self.number
            while number and not TOUR[number].ready(self._toured):
                number -= 1
            self._go(number)

    def _show_on(self, seconds: float, origin: Point) -> None:
        if not self.shows:
            return
        if self.demonstration is None:
            self._show_next(seconds)
            return
        outline = self.outline(origin)
        middle = None
        if outline is not None:
            middle = (outline[0] + outline[2]) / 2, (outline[1] + outline[3]) / 2
        self.demonstration.advance(seconds, self.target, middle, origin)
        if self.demonstration.ended:
            self._hand, self.demonstration, self._rested = self.demonstration.hand, None, 0.0

    def _show_next(self, seconds: float) -> None:
        """Begins with the next part of the step, once the last one had its effect."""
        part, self._rested = self.part, self._rested + seconds
        if part is None or part.waits or (part is self._shown and self._rested < _AGAIN_S):
            return
        self._shown = part
        self.demonstration = Demonstration(self._toured, part, self._hand)

    def _stop_showing(self) -> None:
        self.shows = False
        if self.demonstration is not None:
            self.demonstration.cancel()
            self.demonstration = None


def _is_near(at: Point, box: Rectangle, begin: Point) -> bool:
    """Returns whether a pixel is in a box with some room around it, or near the begin of a drag."""
    left, top, right, bottom = box
    inside = left - _NEAR < at[0] < right + _NEAR and top - _NEAR < at[1] < bottom + _NEAR
    return inside or math.dist(at, begin) < _NEAR
