"""The table of actions while performing. Menus, shortcuts and the help are built from it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

from enliven.wire import Mode
from enliven_viewer.language import later
from enliven_viewer.live.live_stage import LiveStage
from enliven_viewer.live.possession_choice import PART_CHOICES
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.app.workspace_tabs import WORKSPACES
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.perform.stage_switches import LOOSE_LABELS

_FIRST_LABELS = {
    "Remove the character from the stage": "Take the chosen character from the stage",
    "Record an alternative take": "Record beside what was recorded last",
    "Possess together with others": "Possess beside others",
    "Scale with both hands, or end scaling": "Scale with both hands, or let it stay",
    "Reset the character's size": "Its own size again",
    "Lock to the current performers": "Only who is here now performs",
    "Next match": "Next match with the pose",
    "Open or close the microphone": "Open the microphone, or close it",
    "Deformation graphs": "Graph of the meshes",
    "Zoom to the next limb": "Close to the limb that takes hold",
    "Back to live": "Back to what is live",
    "One pose back": "A pose back",
    "One pose forward": "A pose on",
    "Hold with more body parts": "Hold with these parts as well",
    "Less smoothing": "Less smoothed",
    "More smoothing": "More smoothed",
    "Previous match": "Match before",
    "Turn the view to the bones": "See more of the bones",
    "Record the last take again": "Record again from where it began",
    "Physics: No objects": "Physics: Nothing loose",
    **{f"Body parts: {part}": f"With: {part}" for part in PART_CHOICES},
}
"""The first label of each action with a new label. Stored shortcuts name actions by their first labels."""


@dataclass(frozen=True)
class PerformAction:
    """An action: its label, shortcut, function, and the workspaces in which the shortcut is active.

    The shortcut of an action without workspaces is active in all of them.

    Attributes:
        live: True if the action applies to the followed stage or take. It is unavailable if none is followed.
    """

    label: str
    key: str
    do: Callable[[PerformSession], object]
    workspaces: tuple[str, ...] = ()
    live: bool = True
    why_not: Callable[[PerformSession], str] = lambda session: ""
    is_on: Callable[[PerformSession], bool] | None = None
    about: str = ""
    group: str = ""
    apart: bool = False

    @property
    def id(self) -> str:
        """Returns a permanent name such as "perform.possess_alone"."""
        if self.label == _STAND_LABEL:
            return "perform.stand"  # The start page refers to this action, so its name is fixed.
        label = _FIRST_LABELS.get(self.label, self.label)
        return "perform." + re.sub(r"[^a-z]+", "_", label.lower()).strip("_")

    def describe_missing(self, session: PerformSession) -> str:
        """Returns the reason why the action is unavailable now, with advice, or an empty text if it is
        available.
        """
        return (NO_STAGE if self.live and session.live is None else "") or self.why_not(session)


NO_STAGE = later("No stage is connected. Connect to a stage, or start a stage, in the Perform workspace")
"""The message of actions that need a stage."""


def make_perform_actions(session: PerformSession) -> Iterator[Action]:
    """Yields every action, for menus, the command palette and the list of shortcuts."""
    for action in PERFORM_ACTIONS:
        is_on = None if action.is_on is None else partial(action.is_on, session)
        yield Action(
            action.id,
            "Perform",
            action.label,
            (action.key,) if action.key else (),
            partial(action.do, session),
            partial(action.describe_missing, session),
            is_on,
            about=action.about,
            apart=action.apart,
            group=action.group,
            workspaces=action.workspaces,
        )


def _require_live_stage(act: Callable[[LiveStage], object]) -> Callable[[PerformSession], object]:
    """Returns a function on the followed stage or take. It does nothing if no stage or take is followed."""
    return lambda session: act(session.live) if session.live is not None else None


def _make_possess_function(mode: Mode) -> Callable[[PerformSession], object]:
    """Returns a function that lets a performer possess a character, as soon as that is possible."""
    return lambda session: session.possession_requests.press(mode)


def _make_group(
    group: str, rooms: tuple[str, ...], *rows: tuple[str, str, Callable[[LiveStage], object]]
) -> Iterator[PerformAction]:
    """Yields actions on the followed stage for one submenu. Each row contains label, shortcut
    and function.
    """
    for label, key, act in rows:
        yield PerformAction(label, key, _require_live_stage(act), rooms, group=group)


def _make_workspace_switch(workspace_name: str) -> Callable[[PerformSession], object]:
    return lambda session: setattr(session, "active_workspace", workspace_name)


_LIVE_WORKSPACES = ("Perform", "Play")
_STAND_LABEL = "Stand in front of the camera"
PERFORM_ACTIONS = (
    PerformAction(_STAND_LABEL, "", _make_workspace_switch("Perform"), live=False),
    *(
        PerformAction(
            f"Workspace: {room}",
            f"ctrl+{n + 1}",
            _make_workspace_switch(room),
            live=False,
            group="Workspace",
            is_on=lambda session, room=room: session.active_workspace == room,
        )
        for n, room in enumerate(WORKSPACES)
    ),
    PerformAction(
        "Put the chosen character on the stage",
        "ctrl+enter",
        lambda session: session.staged.put_selected(),
        why_not=lambda session: session.staged.describe_missing_to_put(),
        apart=True,
    ),
    PerformAction(
        "Remove the character from the stage",
        "",
        lambda session: session.staged.remove(),
        why_not=lambda session: session.staged.describe_missing_to_remove(),
    ),
    PerformAction(
        "Record, or end the recording",
        "ctrl+r",
        lambda session: session.recording.toggle(),
        why_not=PerformSession.describe_missing_edge,
        apart=True,
    ),
    PerformAction(
        "Record the last take again",
        "",
        lambda session: session.recording.record_again(),
        why_not=PerformSession.describe_missing_edge,
    ),
    PerformAction(
        "Record an alternative take",
        "ctrl+shift+r",
        lambda session: session.recording.record_again(keeps_last=True),
        why_not=PerformSession.describe_missing_recording,
    ),
    PerformAction(
        "Recordings begin here",
        "i",
        lambda session: session.recording.set_span_end(0),
        ("Perform",),
        live=False,
    ),
    PerformAction(
        "Recordings end here",
        "o",
        lambda session: session.recording.set_span_end(1),
        ("Perform",),
        live=False,
    ),
    PerformAction("Possess alone", "p", _make_possess_function("alone"), _LIVE_WORKSPACES, apart=True),
    PerformAction("Possess together with others", "j", _make_possess_function("join"), _LIVE_WORKSPACES),
    PerformAction("Hold with more body parts", "e", _make_possess_function("extend"), _LIVE_WORKSPACES),
    PerformAction("Release", "r", _require_live_stage(LiveStage.release), _LIVE_WORKSPACES),
    PerformAction(
        "Scale with both hands, or end scaling",
        "x",
        _require_live_stage(LiveStage.scale_by_hands),
        _LIVE_WORKSPACES,
        why_not=PerformSession.describe_missing_edge,
    ),
    PerformAction(
        "Reset the character's size",
        "z",
        lambda session: session.live and session.sizes.reset(session.target, session.live.feed.ask),
        _LIVE_WORKSPACES,
        why_not=lambda session: (
            session.describe_missing_edge() or session.sizes.describe_missing_size(session.target)
        ),
    ),
    *(
        PerformAction(
            f"Body parts: {part}",
            str(n + 1),
            _require_live_stage(lambda live, n=n: live.choose_parts(n)),
            _LIVE_WORKSPACES,
            group="Body parts",
            apart=n == 0,
        )
        for n, part in enumerate(PART_CHOICES)
    ),
    *_make_group(
        "Performers",
        _LIVE_WORKSPACES,
        ("Next performer", "b", LiveStage.choose_performer),
        ("Less smoothing", "comma", lambda live: live.change_smoothing(-1)),
        ("More smoothing", "period", lambda live: live.change_smoothing(1)),
        ("Lock to the current performers", "k", LiveStage.toggle_lock),
        ("Learn the room again", "", LiveStage.learn_room),
    ),
    *_make_group(
        "Matches",
        _LIVE_WORKSPACES,
        ("Next match", "n", lambda live: live.show_other_match(1)),
        ("Previous match", "m", lambda live: live.show_other_match(-1)),
    ),
    PerformAction(
        "Open or close the microphone",
        "",
        lambda session: session.voice.toggle(session.client),
        why_not=PerformSession.describe_missing_voice,
        is_on=lambda session: session.voice.is_on,
        about=(
            "Turns spoken commands on or off. The Perform panel shows the recognised words and lists the "
            "commands."
        ),
    ),
    *(
        PerformAction(
            f"Physics: {label}",
            "",
            lambda session, number=number: session.physics.ask(session.client, number),
            why_not=PerformSession.describe_missing_physics,
            is_on=lambda session, number=number: session.physics.number == number,
            group="Physics",
        )
        for number, label in enumerate(LOOSE_LABELS)
    ),
    PerformAction(
        "Turn the view to the bones",
        "v",
        lambda p: p.live and p.live.show_bones(p.editor.camera),
        _LIVE_WORKSPACES,
        group="Show",
    ),
    *_make_group(
        "Show",
        _LIVE_WORKSPACES,
        ("Deformation graphs", "g", lambda live: live.toggle_overlays("graph")),
        ("Performers' skeletons", "s", lambda live: live.toggle_overlays("body", "reveal", "cues")),
    ),
    PerformAction(
        "Zoom to the next limb",
        "c",
        lambda session: session.close_up.toggle(),
        _LIVE_WORKSPACES,
        is_on=lambda session: session.close_up.is_on,
        about=(
            "While a performer's pose chooses a limb, the view zooms in on that limb and also shows it "
            "from the side. Afterwards the view moves back."
        ),
        group="Show",
    ),
    *_make_group("Playback", _LIVE_WORKSPACES, ("Back to live", "l", lambda live: live.playhead.go_live())),
    *_make_group(
        "Playback",
        ("Play",),
        ("Pause the stage", "space", lambda live: live.playhead.toggle_pause()),
        ("One pose back", "left", lambda live: live.playhead.step(-1)),
        ("One pose forward", "right", lambda live: live.playhead.step(1)),
        ("Faster", "up", lambda live: live.playhead.change_speed(1)),
        ("Slower", "down", lambda live: live.playhead.change_speed(-1)),
    ),
)
"""All actions. Actions without a specific workspace come first."""
