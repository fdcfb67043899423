"""The table of what can be done while performing: menus, keys and the help are made of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from enliven_viewer.live import PARTS, LiveStage
from enliven_viewer.studio.perform.session import ROOMS, PerformSession


@dataclass(frozen=True)
class PerformAction:
    """An action: its label, its key, what it does, and the workspaces in which the key means it.

    An action without workspaces has its key in all of them.
    """

    label: str
    key: str
    do: Callable[[PerformSession], object]
    rooms: tuple[str, ...] = ()

    @property
    def keys(self) -> tuple[str, ...]:
        """Its key in every workspace, if it has one."""
        return (self.key,) if self.key and not self.rooms else ()

    @property
    def shown(self) -> str:
        """Its label, with the key that it has in some workspaces alone."""
        return f"{self.label}  ({_SIGNS.get(self.key, self.key.title())})" if self.rooms else self.label


_SIGNS = {"comma": ",", "period": "."}
"""Keys that are read as signs."""


def _live(act: Callable[[LiveStage], object]) -> Callable[[PerformSession], object]:
    """An action on what is followed; without a link it does nothing."""
    return lambda performance: act(performance.live) if performance.live is not None else None


def _go(room: str) -> Callable[[PerformSession], object]:
    return lambda performance: setattr(performance, "room", room)


_HERE = ("Perform", "Play")
PERFORM_ACTIONS = (
    *(PerformAction(f"Workspace: {room}", f"ctrl+{n + 1}", _go(room)) for n, room in enumerate(ROOMS)),
    PerformAction("Put the chosen character on the stage", "ctrl+enter", PerformSession.put),
    PerformAction("Take the chosen character from the stage", "", PerformSession.take_off),
    PerformAction("Record, or end the recording", "ctrl+r", PerformSession.record),
    PerformAction("Possess alone", "p", _live(LiveStage.possess), _HERE),
    PerformAction("Possess beside others", "j", _live(lambda live: live.possess("join")), _HERE),
    PerformAction("Hold with these parts as well", "e", _live(lambda live: live.possess("extend")), _HERE),
    PerformAction("Release", "r", _live(LiveStage.release), _HERE),
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


def pressed(performance: PerformSession, key: str) -> bool:
    """Do what a key means in the workspace; returns whether it meant something."""
    for action in PERFORM_ACTIONS:
        if action.key != key or (action.rooms and performance.room not in action.rooms):
            continue
        if action.rooms and performance.live is None:
            if performance.room == "Play":
                return False  # the project plays there
            performance.need_edge()
        else:
            action.do(performance)
        return True
    return False
