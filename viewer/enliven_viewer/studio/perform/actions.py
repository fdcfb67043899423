"""The table of what can be done while performing: menus, keys and the help are made of it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

from enliven_viewer.live import PARTS, LiveStage
from enliven_viewer.studio.actions import Action, spoken
from enliven_viewer.studio.perform.session import ROOMS, PerformSession


@dataclass(frozen=True)
class PerformAction:
    """An action: its label, its key, what it does, and the workspaces in which the key means it.

    An action without workspaces has its key in all of them.

    Attributes:
        live: whether it is about what is followed, and lacks that where nothing is.
    """

    label: str
    key: str
    do: Callable[[PerformSession], object]
    rooms: tuple[str, ...] = ()
    live: bool = True
    why_not: Callable[[PerformSession], str] = lambda session: ""
    on: Callable[[PerformSession], bool] | None = None

    @property
    def id(self) -> str:
        """A name that stays: "perform.possess_alone"."""
        if self.label == _STAND:
            return "perform.stand"  # the start page shows it
        return "perform." + re.sub(r"[^a-z]+", "_", self.label.lower()).strip("_")

    def lacks(self, session: PerformSession) -> str:
        """Why it cannot be done now, and what to do about it; empty where it can."""
        return (NO_STAGE if self.live and session.live is None else "") or self.why_not(session)


NO_STAGE = "No stage is connected. Connect to one, or start one, in the Perform workspace"
"""What is said of actions that need a stage."""


def perform_actions(session: PerformSession) -> Iterator[Action]:
    """Every action, for menus, the palette and the list of keys."""
    for one in PERFORM_ACTIONS:
        key = (one.key,) if one.key and not one.rooms else ()
        about = f"{spoken(one.key)} in {' and '.join(one.rooms)}." if one.rooms else ""
        on = None if one.on is None else partial(one.on, session)
        yield Action(
            one.id,
            "Perform",
            one.label,
            key,
            partial(one.do, session),
            partial(one.lacks, session),
            on,
            about,
        )


def _live(act: Callable[[LiveStage], object]) -> Callable[[PerformSession], object]:
    """An action on what is followed; without a link it does nothing."""
    return lambda session: act(session.live) if session.live is not None else None


def _go(room: str) -> Callable[[PerformSession], object]:
    return lambda session: setattr(session, "room", room)


_HERE = ("Perform", "Play")
_STAND = "Stand in front of the camera"
PERFORM_ACTIONS = (
    PerformAction(_STAND, "", _go("Perform"), live=False),
    *(
        PerformAction(
            f"Workspace: {room}",
            f"ctrl+{n + 1}",
            _go(room),
            live=False,
            on=lambda session, room=room: session.room == room,
        )
        for n, room in enumerate(ROOMS)
    ),
    PerformAction(
        "Put the chosen character on the stage",
        "ctrl+enter",
        PerformSession.put,
        why_not=PerformSession.lacks_to_put,
    ),
    PerformAction(
        "Take the chosen character from the stage",
        "",
        PerformSession.take_off,
        why_not=PerformSession.lacks_to_take_off,
    ),
    PerformAction(
        "Record, or end the recording",
        "ctrl+r",
        lambda session: session.recording.record(),
        why_not=PerformSession.lacks_edge,
    ),
    PerformAction(
        "Record again from where it began",
        "",
        lambda session: session.recording.again(),
        why_not=PerformSession.lacks_edge,
    ),
    PerformAction(
        "Record beside what was recorded last",
        "ctrl+shift+r",
        lambda session: session.recording.again(beside=True),
        why_not=PerformSession.lacks_recording,
    ),
    PerformAction(
        "Recordings begin here",
        "i",
        lambda session: session.recording.mark(0),
        ("Perform",),
        live=False,
    ),
    PerformAction(
        "Recordings end here",
        "o",
        lambda session: session.recording.mark(1),
        ("Perform",),
        live=False,
    ),
    PerformAction("Possess alone", "p", _live(LiveStage.possess), _HERE),
    PerformAction("Possess beside others", "j", _live(lambda live: live.possess("join")), _HERE),
    PerformAction("Hold with these parts as well", "e", _live(lambda live: live.possess("extend")), _HERE),
    PerformAction("Release", "r", _live(LiveStage.release), _HERE),
    PerformAction(
        "Scale with both hands, or let it stay",
        "x",
        _live(LiveStage.scale_by_hands),
        _HERE,
        why_not=PerformSession.lacks_edge,
    ),
    PerformAction(
        "Its own size again",
        "z",
        lambda session: session.live and session.sizes.reset(session.meant, session.live.feed.ask),
        _HERE,
        why_not=lambda session: session.lacks_edge() or session.sizes.lacks_size(session.meant),
    ),
    *(
        PerformAction(f"With: {part}", str(n + 1), _live(lambda live, n=n: live.choose_parts(n)), _HERE)
        for n, part in enumerate(PARTS)
    ),
    PerformAction("Next performer", "b", _live(LiveStage.choose_performer), _HERE),
    PerformAction("Less smoothed", "comma", _live(lambda live: live.smoother(-1)), _HERE),
    PerformAction("More smoothed", "period", _live(lambda live: live.smoother(1)), _HERE),
    PerformAction("Only who is here now performs", "k", _live(LiveStage.toggle_lock), _HERE),
    PerformAction("Next match with the pose", "n", _live(lambda live: live.browse(1)), _HERE),
    PerformAction("Match before", "m", _live(lambda live: live.browse(-1)), _HERE),
    PerformAction(
        "See more of the bones", "v", lambda p: p.live and p.live.show_bones(p.editor.camera), _HERE
    ),
    PerformAction("Graph of the meshes", "g", _live(lambda live: live.switch("graph")), _HERE),
    PerformAction(
        "Performers' skeletons", "s", _live(lambda live: live.switch("body", "reveal", "cues")), _HERE
    ),
    PerformAction("Back to what is live", "l", _live(lambda live: live.playhead.go_live()), _HERE),
    PerformAction("Pause the stage", "space", _live(lambda live: live.playhead.toggle_pause()), ("Play",)),
    PerformAction("A pose back", "left", _live(lambda live: live.playhead.step(-1)), ("Play",)),
    PerformAction("A pose on", "right", _live(lambda live: live.playhead.step(1)), ("Play",)),
    PerformAction("Faster", "up", _live(lambda live: live.playhead.faster(1)), ("Play",)),
    PerformAction("Slower", "down", _live(lambda live: live.playhead.faster(-1)), ("Play",)),
)
"""Every action, the ones of all workspaces first."""


def pressed(session: PerformSession, key: str) -> bool:
    """Do what a key means in the workspace; returns whether it meant something."""
    for action in PERFORM_ACTIONS:
        if action.key != key or session.room not in action.rooms:
            continue
        if session.live is None and session.room == "Play":
            return False  # the project plays there
        if lacking := action.lacks(session):
            session.editor.toasts.say(*lacking.split(". "))
        else:
            action.do(session)
        return True
    return False
