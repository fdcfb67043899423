"""Records why systemd ended a service: ``python -m enliven.supervision.service_end edge NAME``.

The units of ``enliven install-kiosk`` run this as ``ExecStopPost``. The module imports little, because the
restart waits for it.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping

from enliven.errors import EnlivenError

from .causes import OUT_OF_MEMORY, exit_cause
from .records import RestartRecord, append_restart

_SIGNAL_BASE = 128
"""Exit codes above this number mean a signal, by the convention of shells."""
_CAUSES = {
    "oom-kill": OUT_OF_MEMORY,
    "watchdog": "no progress for too long",
    "timeout": "not ready or not ended in time",
    "protocol": "ended before it was ready",
    "resources": "systemd could not start it",
    "start-limit-hit": "started too often",
}
"""Causes for values of systemd's ``SERVICE_RESULT`` (systemd.exec). Exit codes and signals are described
elsewhere.
"""


def cause_from_systemd(variables: Mapping[str, str]) -> str:
    """Returns why a service ended, from the variables that systemd gives to ``ExecStopPost``.

    Empty if it was stopped or restarted intentionally, or ended by itself without a failure.
    """
    result, status = variables.get("SERVICE_RESULT", ""), variables.get("EXIT_STATUS", "")
    if result in ("", "success"):
        return ""
    if result == "exit-code" and status.isdecimal():
        # Like a shell, the compositor reports the signal that ended its window as an exit code.
        code = int(status)
        return exit_cause(_SIGNAL_BASE - code if code > _SIGNAL_BASE else code)
    if result in ("signal", "core-dump"):
        return f"signal SIG{status.removeprefix('SIG')}"
    return _CAUSES.get(result, result)


def service_from_words(words: list[str]) -> str:
    """Returns the name of a service for operators: "window", "edge NAME", or "edge" for the default edge."""
    return " ".join(words if words[1:] != ["edge"] else words[:1])


def main(words: list[str]) -> int:
    """Records the end of a service. Always returns 0, because a failed record must not delay the restart."""
    cause = cause_from_systemd(os.environ)
    if words and cause:
        try:
            append_restart(RestartRecord(service_from_words(words), time.time(), cause))
        except EnlivenError as error:
            sys.stderr.write(f"enliven: {error}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
