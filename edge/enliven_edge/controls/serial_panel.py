"""A panel of buttons and lamps on a serial port, with the firmware of firmware_configs/panel."""

from __future__ import annotations

import logging
import time

from enliven.errors import ResourceError
from enliven_edge.controls.panel_protocol import (
    GREETING_REQUEST,
    VERSION,
    Lamps,
    PanelKeys,
    encode,
    lamps_message_body,
)
from enliven_edge.controls.serial_pedal import SerialPedal
from enliven_edge.controls.settings import ControlSettings

log = logging.getLogger(__name__)

_READ_TIMEOUT_S = 0.03
"""Seconds to wait for the panel's first byte before checking whether the lamps have changed."""
_MESSAGE_INTERVAL_S = 0.25
"""Seconds between two messages to the panel. After 1 s without a message the panel shows "no edge"."""
_STALE_AFTER_S = 1.0
"""Age, in seconds, at which the state of the stage is too old to be shown. This happens if the edge hangs."""
_SILENCE_TIMEOUT_S = 2.0
"""Maximum time in seconds without a message from the panel. After it, the port is opened again. Noise is
unlikely to damage eight messages in a row."""
_WRITE_TIMEOUT_S = 1.0
"""Seconds to wait for a port that accepts no data."""
_GREETING_TIMEOUT_S = 4.0
"""Seconds within which a panel must send its greeting. An Arduino resets when its port opens, which takes 2
s."""
_CAUSES = {
    "W": "the firmware hung, and the watchdog restarted the panel",
    "B": "the supply voltage was too low",
    "E": "the reset pin was activated",
    "P": "the panel had no power",
}
"""The reasons for a restart in the greeting of a panel that was already present. A boot loader may hide
them (docs/panel.md)."""


class SerialPanel(SerialPedal):
    """One panel: receives presses, sends the lamps' patterns, and exchanges heartbeats."""

    def __init__(self, settings: ControlSettings, where: str) -> None:
        super().__init__(settings, where)
        self._where = where
        self._keys: PanelKeys = PanelKeys()
        self._lamps, self._lamps_set_at = Lamps(), float("-inf")
        self._forget()

    @property
    def is_responding(self) -> bool:
        """Returns True if the panel has sent a greeting in the protocol of this edge, and its press
        counts.
        """
        return self._keys.version == VERSION and self._keys.counts != ""

    def show(self, lamps: Lamps) -> None:
        """Stores the lamps, which the reading thread sends. They expire if they are not renewed in time."""
        self._lamps, self._lamps_set_at = lamps, time.monotonic()

    def open(self) -> None:
        """Opens the port with the short timeouts of the panel's protocol. Requires a new greeting of the
        panel.
        """
        self._forget()
        super().open()
        self._port.timeout, self._port.write_timeout = _READ_TIMEOUT_S, _WRITE_TIMEOUT_S

    def read(self) -> list[str]:
        """Returns the pressed keys, and sends lamps or a heartbeat if they are due.

        Before a panel has sent its greeting, all keys are dropped. The log reports why a panel was restarted.

        Raises:
            ResourceError: if the panel has been silent for too long.
        """
        started_at, received_before, answered = time.monotonic(), self._keys.received, self.is_responding
        keys = super().read()
        self._check_silence(started_at, self._keys.received > received_before)
        if answered and self._keys.cause:
            why = _CAUSES.get(self._keys.cause, "the boot loader of the panel hides the reason")
            log.warning("%s was restarted: %s", self._where, why)
        if self._keys.received:
            self._send_lamps()
        return keys if self.is_responding else []

    def _forget(self) -> None:
        """Resets the state after the port was opened again."""
        self._quiet, self._said, self._said_at = 0.0, "", float("-inf")

    def _send_lamps(self) -> None:
        """Sends the lamps if they changed or a heartbeat is due. Requests a greeting that was missed."""
        now = time.monotonic()
        body = lamps_message_body(self._lamps) if self.is_responding else GREETING_REQUEST
        if self.is_responding and now - self._lamps_set_at > _STALE_AFTER_S:
            return
        if body != self._said or now - self._said_at >= _MESSAGE_INTERVAL_S:
            self._port.write(encode(body))
            self._said, self._said_at = body, now

    def _check_silence(self, started_at: float, received_before: bool) -> None:
        """Adds up the silence, and raises ResourceError if it is too long.

        Only time in which the port is read counts, so that a computer's sleep does not count.

        The silence ends with each message.
        """
        self._quiet = (
            0.0
            if received_before
            else self._quiet + min(time.monotonic() - started_at, 2.0 * _READ_TIMEOUT_S)
        )
        if self._quiet > (_SILENCE_TIMEOUT_S if self._keys.received else _GREETING_TIMEOUT_S):
            remedy = (
                f"Check that the panel has the firmware (docs/panel.md) and uses {self._settings.baud} "
                "bits/s."
            )
            raise ResourceError("the panel does not answer", where=self._where, remedy=remedy)
        if self._keys.version not in ("", VERSION):
            problem = (
                f"the panel uses version {self._keys.version} of the protocol, but this edge uses {VERSION}"
            )
            raise ResourceError(
                problem,
                where=self._where,
                remedy="Flash the firmware in firmware_configs/panel (docs/panel.md).",
            )
