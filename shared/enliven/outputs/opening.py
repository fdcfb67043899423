"""Opens live outputs from their settings, and hands frames to the process that sends them."""

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
    """The outputs of a program. Its methods never wait for a receiver, or for the process that sends.

    Args:
        plans: the outputs.

    Raises:
        InputError: for a wrong mapping file.
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
        """True if the process of the outputs has started, or if none is needed."""
        return self._process is None or self._process.is_ready

    @property
    def process_id(self) -> int | None:
        """The id of the process that sends, or None while there is none."""
        return None if self._process is None else self._process.process_id

    def check(self, characters: Mapping[str, CharacterInfo]) -> None:
        """Checks that the outputs can send the characters that their addresses name.

        Raises:
            InputError: if one cannot.
        """
        for output in self._converters:
            output.check(characters)

    def put(self, frame: LiveFrame) -> None:
        """Hands a frame to every output. It returns at once."""
        if self._process is not None:
            self._process.put(frame)

    def put_health(self, states: Sequence[HealthState]) -> None:
        """Hands health states to every output. It returns at once."""
        if self._process is not None:
            self._process.put_health(states)

    @property
    def troubles(self) -> dict[str, str]:
        """Why outputs lose packets now, by the name of each failing output."""
        return {status.name: status.trouble for status in self.statuses if status.trouble}

    def close(self) -> None:
        """Sends the frame that waits, closes the outputs and ends their process."""
        if self._process is not None:
            self._process.close()
            log.debug("outputs: %d frames skipped", self._process.skipped)
        for status in self.statuses:
            log.debug("output %s: %d packets sent, %d lost", status.name, status.sent, status.errors)


def open_outputs(
    settings: Mapping[str, LiveOutputSettings], folder: Path | None = None, *, insecure: bool = False
) -> OutputSet:
    """Checks the outputs of the settings and the command line, and starts the process that sends them.

    It does not wait for the process. Frames are left out until it is ready, and their events are sent then.

    Args:
        settings: by name.
        folder: of the settings file, to which paths in it are relative. None: the current folder.
        insecure: True if the edge itself uses no keys. Outputs that listen may then listen everywhere, too.

    Raises:
        InputError: for a bad address, a host that is not found, an output that occurs twice, a key of
            another protocol, or a wrong mapping file. Also for an output that other computers can read
            without ``insecure``.
        ResourceError: if a library is not installed, or a port is in use.
    """
    return OutputSet(plan_outputs(settings, folder, insecure=insecure))
