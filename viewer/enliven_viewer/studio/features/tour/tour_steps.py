"""The steps of the tour as a table of sentences, targets, conditions and commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from enliven_viewer.language import later
from enliven_viewer.playback.document import find_bounds
from enliven_viewer.studio.app.targets import Target
from enliven_viewer.studio.features.tour.chair_legs import (
    find_chair_in_image,
    find_leg_to_cut,
    find_piece_to_carry,
)
from enliven_viewer.studio.features.tour.tour_state import TourCounts, TourState

_DANCE_S = 3.0
"""Seconds of dancing before the tour explains how to stop. In this time the dancer swings the arms once."""
_FRAMING_MARGIN = 1.5
"""Size of the view relative to the chair before a leg is cut."""
_FILE_NAME = "My dancing chair"
"""File name that the tour types if it demonstrates that step."""


def _do_nothing(toured: TourState) -> None:
    """Does nothing. Used for a part that only waits."""


@dataclass(frozen=True)
class TourPart:
    """One instruction. The tour shows the first part of a step that is not done yet.

    Attributes:
        text: one sentence.
        target: returns the target at which the tour points.
        is_done: returns True if the part is done, given the counts at the start of the step.
        command: a function with the same effect as a click on the target.
        shift: True if the drag along the target's path needs the Shift key.
        types: text to type into a field; empty for none.
    """

    text: str
    target: Callable[[TourState], Target]
    is_done: Callable[[TourState, TourCounts], bool]
    command: Callable[[TourState], object] = _do_nothing
    shift: bool = False
    types: str = ""

    @property
    def waits(self) -> bool:
        """Returns True if the part only waits for an event and needs no user action."""
        return self.command is _do_nothing and not self.types


@dataclass(frozen=True)
class TourStep:
    """A step of the tour. It is done once its last part is done.

    Attributes:
        title: a few words.
        icon: its glyph in Font Awesome 4.
        parts: its instructions.
        ready: returns True if its preconditions are met. Otherwise the tour returns to an earlier step.
        begin: called when the step starts.
    """

    title: str
    icon: str
    parts: tuple[TourPart, ...]
    ready: Callable[[TourState], bool] = lambda toured: True
    begin: Callable[[TourState], object] = _do_nothing

    def part(self, toured: TourState, before: TourCounts) -> TourPart | None:
        """Returns the first part that is not done, or None once the step is done."""
        if self.parts[-1].is_done(toured, before):
            return None
        return next(part for part in self.parts if not part.is_done(toured, before))


def _target_widget(*names: str) -> Callable[[TourState], Target]:
    return lambda toured: Target(names)


def _target_perform_widget(*names: str) -> Callable[[TourState], Target]:
    """Returns a function that targets a widget of the Perform panel. If another panel hides it, the target is
    the widget that closes that panel.
    """
    return lambda toured: Target((*names, *(panel.back for panel in toured.workspace.panels if panel.back)))


def _run_action(action: str) -> Callable[[TourState], object]:
    return lambda toured: toured.workspace.actions.do(action)


def _go_to_workspace(workspace_name: str) -> Callable[[TourState], object]:
    return lambda toured: setattr(toured.workspace.tabs, "active", workspace_name)


def _call_dancer(toured: TourState) -> None:
    toured.workspace.run_and_report(lambda: toured.perform.connect_local("--loop"))


def _possess_chair(toured: TourState) -> None:
    if toured.chair is not None:
        toured.workspace.editor.select_only(toured.chair.id)
    toured.workspace.actions.do("perform.possess_alone")


def _target_leg(toured: TourState) -> Target:
    chair = toured.chair
    return Target() if chair is None else find_leg_to_cut(toured.workspace.editor, chair)


def _target_piece(toured: TourState) -> Target:
    chair, piece = toured.chair, toured.piece
    if chair is None or piece is None:
        return Target()
    return find_piece_to_carry(toured.workspace.editor, piece, chair)


def _play_recording(toured: TourState) -> None:
    """Plays the recording."""
    if toured.dances:
        toured.workspace.editor.playing = True


def _look_at_chair(toured: TourState) -> None:
    """Frames the dancing chair, with room to draw around it."""
    _play_recording(toured)
    extent, editor = toured.extent, toured.workspace.editor
    if extent is not None:
        box = find_bounds([extent])
        if box is not None:
            editor.camera.frame(
                box, editor.size[0] / max(editor.size[1], 1.0), reset=False, margin=_FRAMING_MARGIN
            )


def _save_project(toured: TourState) -> None:
    browser = toured.workspace.browser
    if browser is not None:
        toured.workspace.run_and_report(lambda: toured.workspace.finish_file_dialog(browser.get_path()))


def _has_name(toured: TourState) -> bool:
    browser = toured.workspace.browser
    return browser is not None and browser.name.partition(".")[0] not in ("", "Untitled")


def _drag_along_path(toured: TourState) -> None:
    """Does nothing. Used for a part with a demonstration that drags along the target's path."""


_ANIMATE_PART = TourPart(
    later("Click “Animate”: here you can change your chair."),
    _target_widget("room Animate"),
    lambda t, before: t.has_workshop,
    _go_to_workspace("Animate"),
)
_PERFORM_PART = TourPart(
    later("Click “Perform”: here is the stage."),
    _target_widget("room Perform"),
    lambda t, before: t.workspace.tabs.active == "Perform",
    _go_to_workspace("Perform"),
)
_CUT_PART = TourPart(
    later("Click “Cut”: these are your scissors."),
    _target_widget("tool cut"),
    lambda t, before: t.has_tool("cut"),
    _run_action("tool.cut"),
)

TOUR_STEPS = (
    TourStep(
        later("Get a chair"),
        "\uf067",
        (
            _ANIMATE_PART,
            TourPart(
                later("Click “Armchair”: the chair comes onto the stage."),
                _target_widget("do Armchair"),
                lambda t, before: len(t.chairs) > before.chairs or (bool(t.chairs) and not t.dances),
                _run_action("sample.chair"),
            ),
        ),
    ),
    TourStep(
        later("Call a dancer"),
        "\uf007",
        (
            _PERFORM_PART,
            TourPart(
                later("Click “A recorded person”, or your own camera above that button."),
                _target_perform_widget("recorded person", "leave"),
                lambda t, before: t.has_stage,
                _call_dancer,
            ),
            TourPart(
                later("The dancer is coming. Wait a little."),
                _target_widget("stage state"),
                lambda t, before: t.has_dancer,
            ),
        ),
        lambda t: bool(t.chairs),
    ),
    TourStep(
        later("Step into the chair"),
        "\uf090",
        (
            _PERFORM_PART,
            TourPart(
                later("Click “Possess”: now the dancer moves the chair."),
                _target_perform_widget("possess"),
                lambda t, before: t.is_held,
                _possess_chair,
            ),
        ),
        lambda t: t.has_dancer,
    ),
    TourStep(
        later("Keep the dance"),
        "\uf111",
        (
            _PERFORM_PART,
            TourPart(
                later("Click “Record”, and count along: three, two, one."),
                _target_perform_widget("record"),
                lambda t, before: t.records or t.dances,
                _run_action("perform.record_or_end_the_recording"),
            ),
            TourPart(
                later("Look: the chair moves as the dancer moves."),
                lambda t: find_chair_in_image(t.workspace.editor, t.extent),
                lambda t, before: t.recorded_s > _DANCE_S or t.dances,
            ),
            TourPart(
                later("Click “Stop” when you have seen enough."),
                _target_perform_widget("record"),
                lambda t, before: t.dances and not t.records,
                _run_action("perform.record_or_end_the_recording"),
            ),
        ),
        lambda t: t.is_held or t.records or t.dances,
    ),
    TourStep(
        later("Take the scissors"),
        "\uf0c4",
        (_ANIMATE_PART, _CUT_PART),
        lambda t: bool(t.chairs),
    ),
    TourStep(
        later("Cut a leg off"),
        "\uf0c4",
        (
            _ANIMATE_PART,
            _CUT_PART,
            TourPart(
                later("Drag across the leg, along the arrow: the chair holds still for you."),
                _target_leg,
                lambda t, before: len(t.chairs) > before.chairs,
                _drag_along_path,
            ),
        ),
        lambda t: bool(t.chairs),
        _look_at_chair,
    ),
    TourStep(
        later("Put the leg somewhere else"),
        "\uf047",
        (
            _ANIMATE_PART,
            TourPart(
                later("Click “Move, merge”: now you can carry the leg."),
                _target_widget("tool carry"),
                lambda t, before: t.has_tool("carry"),
                _run_action("tool.carry"),
            ),
            TourPart(
                later("Hold the Shift key, and drag the leg along the arrow."),
                _target_piece,
                lambda t, before: t.counts.merges > before.merges,
                _drag_along_path,
                shift=True,
            ),
        ),
        lambda t: len(t.chairs) > 1,
        _play_recording,
    ),
    TourStep(
        later("Keep your chair"),
        "\uf0c7",
        (
            TourPart(
                later("Click “File”, and then “Save”."),
                _target_widget("menu File/Save", "menu File", "menu all"),
                lambda t, before: t.workspace.asking in ("save as", "changed"),
                _run_action("file.save"),
            ),
            TourPart(
                later("Type a name for your chair."),
                _target_widget("file name"),
                lambda t, before: _has_name(t),
                types=_FILE_NAME,
            ),
            TourPart(
                later("Click “Save”: now nothing is lost."),
                _target_widget("dialog Save"),
                lambda t, before: t.is_saved,
                _save_project,
            ),
        ),
    ),
)
"""The steps, in order. Each takes about a quarter of a minute."""

ENDING = (later("You did it"), later("Your chair is saved. Open the file again, and the chair dances."))
"""Title and sentence shown once all steps are done."""
