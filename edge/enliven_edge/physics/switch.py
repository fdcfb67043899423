"""The physics of a running edge: switched on, off, or to other objects by a viewer's order."""

from __future__ import annotations

import logging
import threading
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from enliven.document import Character, Props
from enliven.errors import EnlivenError, ResourceError
from enliven.wire import PhysicsMessage
from enliven_edge.extras import need
from enliven_edge.physics.settings import PhysicsSettings, WorldName
from enliven_edge.stage import Tick

if TYPE_CHECKING:
    from enliven_edge.physics.playground import Playground

log = logging.getLogger(__name__)

_WHERE = "physics"
"""The part of the edge that errors name."""
_MOST_LETTERS = 160
"""Letters of a sentence that the wire carries."""


class _Preparation(threading.Thread):
    """Loads the engine and packs characters into spheres while the frames go on."""

    def __init__(self, settings: PhysicsSettings, characters: list[Character]) -> None:
        super().__init__(name="preparation of the physics", daemon=True)
        self._given = settings, characters
        self.result: Playground | EnlivenError | None = None

    def run(self) -> None:
        from enliven_edge.physics.playground import Playground

        try:
            playground = Playground(*self._given)
            playground.warm_up()
            self.result = playground
        except EnlivenError as error:
            self.result = error
        except Exception:
            log.exception("the physics could not be prepared")
            self.result = ResourceError(
                "the physics could not be prepared", where=_WHERE, mend="The edge's log has the details."
            )


class PhysicsSwitch:
    """The loose objects of an edge; there may be none.

    Args:
        settings: of the engine and its objects; viewers choose ``world`` later.
        live: whether frames come in real time; a recording gives the same objects each time.
        playground: what is on from the start; None for nothing.
    """

    def __init__(
        self,
        settings: PhysicsSettings | None = None,
        *,
        live: bool = True,
        playground: Playground | None = None,
    ) -> None:
        settings = settings or PhysicsSettings()
        if not live:
            settings = replace(settings, engine=replace(settings.engine, budget=0.0))
        self._settings = settings
        self._playground = playground
        self._preparation: _Preparation | None = None
        self._characters: Mapping[str, Character] = {}
        self._clears = False
        on = playground is not None
        world = playground.settings.world if playground is not None else "none"
        self._state = PhysicsMessage(world, "on" if on else "off")
        self._told: PhysicsMessage | None = None

    def ask(self, world: Literal["none", "boxes", "dodgeball"]) -> None:
        """Switches to other objects; "none" removes them.

        Raises:
            ResourceError: if the engine is not installed.
        """
        if world != "none":
            try:
                need("mujoco", "physics", _WHERE)
            except ResourceError as error:
                self._state = PhysicsMessage(world, "missing", error.what, error.mend or "")
                raise
        self._clears = self._playground is not None
        self._playground = self._preparation = None
        if world == "none":
            self._state = PhysicsMessage("none", "off")
            return
        self._state = PhysicsMessage(world, "preparing")
        self._preparation = _Preparation(self._with(world), list(self._characters.values()))
        self._preparation.start()

    def show(self, characters: Mapping[str, Character]) -> None:
        """Introduces the characters that are on the stage; call once a frame."""
        self._characters = dict(characters)
        if self._preparation is not None and (result := self._preparation.result) is not None:
            self._preparation = None
            self._begin(result)
        if self._playground is not None:
            self._playground.show(characters)

    def step(self, tick: Tick) -> Props | None:
        """Returns the objects after a frame; no objects once after they were removed; None without any."""
        if self._playground is not None:
            self._clears = False
            return self._playground.step(tick)
        if not self._clears:
            return None
        self._clears = False
        return _nothing(tick.time_ns)

    def change(self) -> PhysicsMessage | None:
        """Returns the state if it changed since the last call."""
        if self._state == self._told:
            return None
        self._told = self._state
        return self._state

    def _with(self, world: WorldName) -> PhysicsSettings:
        return replace(self._settings, world=world)

    def _begin(self, result: Playground | EnlivenError) -> None:
        """Puts the prepared objects on the stage, or keeps the reason why there are none."""
        if isinstance(result, EnlivenError):
            what, mend = result.what[:_MOST_LETTERS], (result.mend or "")[:_MOST_LETTERS]
            self._state = PhysicsMessage(self._state.world, "failed", what, mend)
            return
        self._playground = result
        self._state = PhysicsMessage(self._state.world, "on")


def _nothing(time_ns: int) -> Props:
    """Returns no objects at a moment: viewers remove the last ones."""
    return Props(
        time_ns,
        np.arange(0),
        np.zeros(0, np.uint8),
        np.zeros((0, 3), np.float32),
        np.zeros((0, 3), np.uint8),
        np.zeros((0, 3)),
        np.zeros((0, 4)),
    )
