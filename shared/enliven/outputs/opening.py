"""Opens live outputs from their settings, and passes frames to the process that sends them."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

from enliven.health import HealthState
from enliven.outputs.live_frame import CharacterInfo, LiveFrame
from enliven.outputs.output_plan import OutputPlan, plan_outputs
from enliven.outputs.process.output_process import OutputProcess
from enliven.outputs.process.output_status import OutputStatus
from enliven.outputs.settings import LiveOutputSettings
from enliven.supervision.closeable import Closeable

log = logging.getLogger(__name__)


class OutputSet(Closeable):
    """The outputs of a program. Its methods never wait for a receiver or for the sending process.

    Args:
        plans: the checked settings of the outputs.

    Raises:
        InputError: if a mapping file is invalid.
    """

    def __init__(self, plans: Sequence[OutputPlan] = ()) -> None:
        self._converters = [output for plan in plans if (output := plan.convert()) is not None]
        self._process = OutputProcess(plans) if plans else None

    @property
    def statuses(self) -> list[OutputStatus]:
        """The state of each output."""
        return [] if self._process is None else self._process.statuses

    @property
    def is_ready(self) -> bool:
        """True if the sending process has opened all outputs, or if no process is needed."""
        return self._process is None or self._process.is_ready

    @property
    def process_id(self) -> int | None:
        """The id of the sending process, or None while no process runs."""
        return None if self._process is None else self._process.process_id

    def check(self, characters: Mapping[str, CharacterInfo]) -> None:
        """Checks that the outputs can send the characters that their addresses name.

        Raises:
            InputError: if one cannot.
        """
        for output in self._converters:
            output.check(characters)

    def put(self, frame: LiveFrame) -> None:
        """Passes a frame to every output. Returns immediately."""
        if self._process is not None:
            self._process.put(frame)

    def put_health(self, states: Sequence[HealthState]) -> None:
        """Passes health states to every output. Returns immediately."""
        if self._process is not None:
            self._process.put_health(states)

    @property
    def troubles(self) -> dict[str, str]:
        """The reason for current packet losses, by the name of each failing output."""
        return {status.name: status.trouble for status in self.statuses if status.trouble}

    def close(self) -> None:
        """Sends the last queued frame, closes the outputs and ends their process."""
        if self._process is not None:
            self._process.close()
            log.debug("outputs: %d frames skipped", self._process.skipped)
        for status in self.statuses:
            log.debug("output %s: %d packets sent, %d lost", status.name, status.sent, status.errors)


def open_outputs(
    settings: Mapping[str, LiveOutputSettings], folder: Path | None = None, *, insecure: bool = False
) -> OutputSet:
    """Checks the outputs in the settings and on the command line, and starts the process that sends them.

    Does not wait for the process. Until the process is ready, frames are skipped, but their events are sent
    later.

    Args:
        settings: the settings of each output, by name.
        folder: folder of the settings file. Paths in the file are relative to it. None means the current
            folder.
        insecure: True if the edge runs without authentication. Then outputs may also listen on addresses that
            other computers can reach.

    Raises:
        InputError: if an address, a host name, a key or a mapping file is invalid, or an output occurs twice.
            Also if other computers could read an output although ``insecure`` is not set.
        ResourceError: if a library is not installed, or a port is in use.
    """
    return OutputSet(plan_outputs(settings, folder, insecure=insecure))
