"""The state of the tour. It detects finished steps and moves forward and back. The user can leave and resume
it.
"""

from __future__ import annotations

import math

from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.targets import DrawnWidgets, Rectangle, Target
from enliven_viewer.studio.features.tour.chair_legs import find_chair_in_image
from enliven_viewer.studio.features.tour.demonstration import Demonstration
from enliven_viewer.studio.features.tour.tour_state import TourState
from enliven_viewer.studio.features.tour.tour_steps import ENDING, TOUR_STEPS, TourPart, TourStep
from enliven_viewer.studio.viewport.overlay import Point

_DONE_DISPLAY_S = 1.2
"""Seconds for which a finished step stays on the screen with a tick, before the next step."""
_REPEAT_DELAY_S = 6.0
"""After this number of seconds, a demonstration without effect is repeated. The stage may have been busy."""
_PAUSE_DISTANCE_PX = 30.0
"""Distance in pixels from the target within which the pointer pauses a dancing chair."""
_MISSING_TIMEOUT_S = 2.0
"""The tour goes back if a precondition is missing for this number of seconds. Tracking of the dancer may fail
for a moment.
"""


class Tour:
    """The tour through the studio. Args: app: the studio. widgets: the rectangles of widgets.
        number: number of the step at which to resume. If its preconditions are missing, the tour starts at an
            earlier step.

    Attributes:
        number: number of the current step; the number of steps once all are done.
        done_display_s: remaining seconds for which the finished step stays on the screen.
        reviewing: True if an earlier, finished step is shown again. It stays until *Next* is pressed.
        is_demonstrating: whether the tour demonstrates the step.
        demonstration: the animated hand while it moves.
        target: the current target.
        card: last position of the card, in the window's pixels. card_key: content of the card at that time.
    """

    def __init__(self, app: App, widgets: DrawnWidgets, number: int = 0) -> None:
        self._state, self._widgets = TourState(app), widgets
        self.number, self.done_display_s, self.reviewing = min(number, len(TOUR_STEPS) - 1), 0.0, False
        self.is_demonstrating = False
        self.demonstration: Demonstration | None = None
        self.target = Target()
        self.card: Point | None = None
        self.card_key: tuple[object, ...] = ()
        self._demonstrated_part: TourPart | None = None
        self._idle_s, self._hand = 0.0, (0.0, 0.0)
        self._missing_s = 0.0
        self._counts_before = self._state.counts
        self._is_new, self._has_paused = True, False
        while self.number and not TOUR_STEPS[self.number].ready(self._state):
            self.number -= 1

    @property
    def step(self) -> TourStep | None:
        """Returns the current step, or None once all are done."""
        return TOUR_STEPS[self.number] if self.number < len(TOUR_STEPS) else None

    @property
    def part(self) -> TourPart | None:
        """Returns the current part of the step, or None once the step or the tour is done."""
        step = self.step
        return (
            None if step is None or self.done_display_s > 0.0 else step.part(self._state, self._counts_before)
        )

    @property
    def title(self) -> str:
        """Returns the title of the step."""
        return ENDING[0] if self.step is None else self.step.title

    @property
    def text(self) -> str:
        """Returns the current instruction, or an empty text while a tick is shown."""
        if self.step is None:
            return ENDING[1]
        part = self.part
        return "" if part is None else part.text

    @property
    def wants_samples(self) -> bool:
        """Returns True if the start page must be shown, because its samples are the target."""
        return any(name.startswith("do ") for name in self.target.widgets)

    @property
    def is_moving(self) -> bool:
        """Returns True if the tour is animating, so that the window must not idle."""
        return self.is_demonstrating or self.done_display_s > 0.0

    def outline(self, origin: Point) -> Rectangle | None:
        """Returns the bounding box of the target, in the window's pixels, or None if it is not visible.

        Args:
            origin: the top left corner of the image, in the window's pixels.
        """
        if self.target.box is not None:
            left, top, right, bottom = self.target.box
            return left + origin[0], top + origin[1], right + origin[0], bottom + origin[1]
        widget = self._widgets.find(self.target.widgets)
        return None if widget is None else widget[1]

    def find_chair_rectangle(self, origin: Point) -> Rectangle | None:
        """Returns the bounding box of the chair in the window's pixels, which the card must not cover.

        Returns None without a chair.
        """
        box = find_chair_in_image(self._state.workspace.editor, self._state.extent).box
        if box is None:
            return None
        return box[0] + origin[0], box[1] + origin[1], box[2] + origin[0], box[3] + origin[1]

    def check_progress(self, seconds: float, origin: Point = (0.0, 0.0)) -> None:
        """Checks if the step is done. Call once per frame with the seconds since the last call."""
        step = self.step
        if step is None:
            self.target = Target()
            self._widgets.set_targets(())
            return
        if self.done_display_s > 0.0:
            self._mark_done(seconds)
        elif not self.reviewing:
            if self._is_done(step):
                self.done_display_s = _DONE_DISPLAY_S
                self._stop_demonstration()
            else:
                self._check_preconditions(step, seconds)
        if self._is_new and self.step is not None:
            self._is_new = False
            self.step.begin(self._state)
        part = self.part
        self.target = Target() if part is None else part.target(self._state)
        self._widgets.set_targets(self.target.widgets)
        self._pause_near_target()
        self._continue_demonstration(seconds, origin)

    def skip(self) -> None:
        """Moves to the next step, and first establishes its preconditions."""
        self._go_to_step(self.number + 1)
        while self.number < len(TOUR_STEPS) - 1 and not TOUR_STEPS[self.number].ready(self._state):
            self._go_to_step(self.number + 1)

    def back(self) -> None:
        """Shows the previous step. If it is already done, it stays until :meth:`skip`."""
        self._go_to_step(max(self.number - 1, 0))
        step = self.step
        self.reviewing = step is not None and self._is_done(step)

    def demonstrate_step(self, start: Point) -> None:
        """Demonstrates the step. The hand starts at a pixel of the window."""
        if self.part is not None and not self.is_demonstrating:
            self.is_demonstrating, self._hand, self._demonstrated_part = True, start, None

    def _pause_near_target(self) -> None:
        """Pauses playback while the pointer is near the target, because a dancing leg is hard to hit."""
        editor, hands = self._state.workspace.editor, self._state.workspace.input
        if hands.busy or self.demonstration is not None:
            return
        path, box = self.target.path, self.target.box
        is_pointer_near = bool(path) and box is not None and _is_near(hands.at, box, path[0])
        if is_pointer_near and editor.playing:
            editor.playing, self._has_paused = False, True
        elif not is_pointer_near:
            self._resume_playback()

    def _resume_playback(self) -> None:
        """Resumes playback that the tour has paused."""
        if self._has_paused:
            self._state.workspace.editor.playing, self._has_paused = True, False

    def restore_state(self) -> None:
        """Restores playback, pointer and widgets."""
        self._stop_demonstration()
        self._resume_playback()
        self._widgets.set_targets(())

    def _go_to_step(self, number: int) -> None:
        self._stop_demonstration()
        self.number, self.done_display_s, self.reviewing, self._missing_s = number, 0.0, False, 0.0
        self._counts_before, self._is_new = self._state.counts, True

    def _mark_done(self, seconds: float) -> None:
        self.done_display_s -= seconds
        if self.done_display_s <= 0.0:
            self._go_to_step(self.number + 1)

    def _is_done(self, step: TourStep) -> bool:
        return step.part(self._state, self._counts_before) is None

    def _check_preconditions(self, step: TourStep, seconds: float) -> None:
        """Goes back if the preconditions of a step have been missing for a while."""
        self._missing_s = 0.0 if step.ready(self._state) else self._missing_s + seconds
        if self._missing_s > _MISSING_TIMEOUT_S:
            number = self.number
            while number and not TOUR_STEPS[number].ready(self._state):
                number -= 1
            self._go_to_step(number)

    def _continue_demonstration(self, seconds: float, origin: Point) -> None:
        if not self.is_demonstrating:
            return
        if self.demonstration is None:
            self._demonstrate_next(seconds)
            return
        outline = self.outline(origin)
        middle = None
        if outline is not None:
            middle = (outline[0] + outline[2]) / 2, (outline[1] + outline[3]) / 2
        self.demonstration.advance(seconds, self.target, middle, origin)
        if self.demonstration.ended:
            self._hand, self.demonstration, self._idle_s = self.demonstration.hand, None, 0.0

    def _demonstrate_next(self, seconds: float) -> None:
        """Starts to demonstrate the next part of the step once the previous part had its effect."""
        part, self._idle_s = self.part, self._idle_s + seconds
        if part is None or part.waits or (part is self._demonstrated_part and self._idle_s < _REPEAT_DELAY_S):
            return
        self._demonstrated_part = part
        self.demonstration = Demonstration(self._state, part, self._hand)

    def _stop_demonstration(self) -> None:
        self.is_demonstrating = False
        if self.demonstration is not None:
            self.demonstration.cancel()
            self.demonstration = None


def _is_near(at: Point, box: Rectangle, begin: Point) -> bool:
    """Returns True if a pixel is in a box with a margin, or near the start of a drag."""
    left, top, right, bottom = box
    inside = (
        left - _PAUSE_DISTANCE_PX < at[0] < right + _PAUSE_DISTANCE_PX
        and top - _PAUSE_DISTANCE_PX < at[1] < bottom + _PAUSE_DISTANCE_PX
    )
    return inside or math.dist(at, begin) < _PAUSE_DISTANCE_PX
