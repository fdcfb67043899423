"""All controls of an edge: opened by its settings, polled between two frames."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import cast

from enliven.errors import EnlivenError, InputError
from enliven.wire import Order
from enliven_edge.closing import Closing
from enliven_edge.controls.base import CALLS, WORDS, Call, Command, ControlReader, Device, checked_map, orders
from enliven_edge.controls.panel_protocol import Lamps
from enliven_edge.controls.settings import ControlSettings, refuse_other_kinds
from enliven_edge.stage import Stage

log = logging.getLogger(__name__)


class Controls(Closing):
    """Carries out the commands of several controls on the stage."""

    def __init__(self, controls: Sequence[ControlReader]) -> None:
        self._controls = list(controls)

    def apply_commands(
        self, stage: Stage, carry_out: Callable[[Order], None], call: Callable[[Call, str], None]
    ) -> None:
        """Carries out the commands since the last time; a command that fails is logged.

        Args:
            call: tells windows what they are to do, and which control says so.
        """
        for control in self._controls:
            for word in control.poll():
                log.info("%s: %s", control.name, word)
                if word in CALLS:
                    call(cast(Call, word), control.name)
                for order in orders(word, stage):
                    try:
                        carry_out(order)
                    except EnlivenError as error:
                        log.warning("%s: %s was refused: %s", control.name, word, error)

    def show(self, lamps: Lamps) -> None:
        """Shows the state of the stage; a lamp changes to "no edge" where this is not called for a second."""
        for control in self._controls:
            control.show(lamps)

    @property
    def missing(self) -> list[str]:
        """The names of the controls that search for their devices."""
        return [control.name for control in self._controls if not control.there]

    def forget(self) -> None:
        """Drops the commands so far: the stage was not ready."""
        for control in self._controls:
            control.poll()

    def close(self) -> None:
        """Releases all devices."""
        for control in self._controls:
            control.close()


def open_controls(settings: Mapping[str, ControlSettings], folder: Path | None = None) -> Controls:
    """Opens all controls of a settings file.

    Args:
        folder: of the file, where its paths begin.

    Raises:
        InputError: for a map or a key that cannot be meant.
        ResourceError: where a library that one of them needs is missing. A device that is missing is no
            error: it is looked for until it is there.
    """
    ready = [(name, one, device_of(name, one, folder)) for name, one in settings.items()]
    return Controls(
        [
            ControlReader(name, device, words_of(name, one), one.debounce, one.retry)
            for name, one, device in ready
        ]
    )


def words_of(name: str, settings: ControlSettings) -> dict[str, Command]:
    """Returns the command of each of a control's keys; without a map the keys are the commands.

    Raises:
        InputError: for an unknown command, or a voice without phrases.
    """
    if settings.kind == "voice" and not settings.map:
        mend = 'Such as "puppet let it go" = "release".'
        raise InputError("a voice needs phrases", where=f"controls.{name}.map", mend=mend)
    return checked_map(
        settings.map or {word: word for word in WORDS if word != "parts"}, f"controls.{name}.map"
    )


def device_of(name: str, settings: ControlSettings, folder: Path | None = None) -> Device:
    """Returns a control's device, not opened yet; its library is imported only here."""
    where = f"controls.{name}"
    refuse_other_kinds(settings, where)
    words = words_of(name, settings)
    if settings.kind == "serial" and settings.sends == "panel":
        from enliven_edge.controls.serial_panel import SerialPanel

        return SerialPanel(settings, where)
    if settings.kind == "serial":
        from enliven_edge.controls.serial_pedal import SerialPedal

        return SerialPedal(settings, where)
    if settings.kind == "hid":
        from enliven_edge.controls.hid_pedal import HidPedal

        return HidPedal(settings, where)
    from enliven_edge.controls.voice import Voice

    return Voice(settings, list(words), where, folder)
