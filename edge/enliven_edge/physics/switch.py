"""Switches the physics of a running edge on or off, or to other objects, when a viewer requests it."""

from __future__ import annotations

import logging
import threading
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from enliven.doctor import need
from enliven.document import Character, Props
from enliven.errors import EnlivenError, ResourceError
from enliven.wire import PhysicsMessage
from enliven_edge.physics.settings import PhysicsSettings, WorldName
from enliven_edge.stage.tick import Tick

if TYPE_CHECKING:
    from enliven_edge.physics.playground import Playground

log = logging.getLogger(__name__)

_WHERE = "physics"
"""The part of the edge that error messages name."""
_MAX_MESSAGE_LENGTH = 160
"""Maximum number of characters of a sentence in a wire message."""


class _Preparation(threading.Thread):
    """Loads the engine and fits spheres to the characters in the background."""

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
                "the physics could not be prepared",
                where=_WHERE,
                remedy="The log of the edge contains the details.",
            )


class PhysicsSwitch:
    """The physics objects of an edge, if any.

    Args:
        settings: settings of the engine and its objects. Viewers choose ``world`` later.
        live: True if frames arrive in real time. A recording must give the same objects each time, so no time
            budget applies.
        playground: the world at the start; None without objects.
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
        is_on = playground is not None
        world = playground.settings.world if playground is not None else "none"
        self._state = PhysicsMessage(world, "on" if is_on else "off")
        self._told: PhysicsMessage | None = None

    @property
    def world(self) -> WorldName:
        """Returns the name of the objects that are on the stage or are being prepared."""
        return self._state.world if self._state.state in ("on", "preparing") else "none"

    def switch_to(self, world: Literal["none", "boxes", "dodgeball"]) -> None:
        """Switches to other objects; "none" removes them.

        Raises:
            ResourceError: if the engine is not installed.
        """
        if world != "none":
            try:
                need("mujoco", "physics", _WHERE)
            except ResourceError as error:
                self._state = PhysicsMessage(world, "missing", error.what, error.remedy or "")
                raise
        self._clears = self._playground is not None
        self._playground = self._preparation = None
        if world == "none":
            self._state = PhysicsMessage("none", "off")
            return
        self._state = PhysicsMessage(world, "preparing")
        self._preparation = _Preparation(self._make_changed_settings(world), list(self._characters.values()))
        self._preparation.start()

    def show(self, characters: Mapping[str, Character]) -> None:
        """Adds the characters that are on the stage. Call it once per frame."""
        self._characters = dict(characters)
        if self._preparation is not None and (result := self._preparation.result) is not None:
            self._preparation = None
            self._show_result(result)
        if self._playground is not None:
            self._playground.show(characters)

    def step(self, tick: Tick) -> Props | None:
        """Returns the objects after a frame. After their removal, returns an empty set once, then None."""
        if self._playground is not None:
            self._clears = False
            return self._playground.step(tick)
        if not self._clears:
            return None
        self._clears = False
        return _empty_props(tick.time_ns)

    def take_changed_state(self) -> PhysicsMessage | None:
        """Returns the state if it changed since the last call."""
        if self._state == self._told:
            return None
        self._told = self._state
        return self._state

    def _make_changed_settings(self, world: WorldName) -> PhysicsSettings:
        return replace(self._settings, world=world)

    def _show_result(self, result: Playground | EnlivenError) -> None:
        """Puts the prepared objects on the stage, or stores the reason of the failure."""
        if isinstance(result, EnlivenError):
            problem, remedy = result.what[:_MAX_MESSAGE_LENGTH], (result.remedy or "")[:_MAX_MESSAGE_LENGTH]
            self._state = PhysicsMessage(self._state.world, "failed", problem, remedy)
            return
        self._playground = result
        self._state = PhysicsMessage(self._state.world, "on")


def _empty_props(time_ns: int) -> Props:
    """Returns an empty set of objects, so that viewers remove the last ones."""
    return Props(
        time_ns,
        np.arange(0),
        np.zeros(0, np.uint8),
        np.zeros((0, 3), np.float32),
        np.zeros((0, 3), np.uint8),
        np.zeros((0, 3)),
        np.zeros((0, 4)),
    )
