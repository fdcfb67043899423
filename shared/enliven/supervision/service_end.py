"""Records why systemd ended a service: ``python -m enliven.supervision.service_end edge NAME``.

The systemd units of ``enliven install-kiosk`` run this module as ``ExecStopPost``. It imports few modules,
because the restart waits for it.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Mapping

from enliven.errors import EnlivenError

from .causes import OUT_OF_MEMORY_CAUSE, describe_exit
from .records import RestartRecord, append_restart

_SIGNAL_BASE = 128
"""By the convention of shells, an exit code above this number means the signal with the number of the
difference."""
_CAUSE_BY_RESULT = {
    "oom-kill": OUT_OF_MEMORY_CAUSE,
    "watchdog": "no progress for too long",
    "timeout": "not ready or not ended in time",
    "protocol": "ended before it was ready",
    "resources": "systemd could not start it",
    "start-limit-hit": "started too often",
}
"""Causes by value of systemd's ``SERVICE_RESULT`` (systemd.exec). Exit codes and signals are described by
:func:`describe_exit`.
"""


def cause_from_systemd(variables: Mapping[str, str]) -> str:
    """Returns the reason why a service ended, from the environment variables that systemd sets for
    ``ExecStopPost``.

    The result is empty if the service was stopped or restarted intentionally, or ended by itself without a
    failure.
    """
    result, status = variables.get("SERVICE_RESULT", ""), variables.get("EXIT_STATUS", "")
    if result in ("", "success"):
        return ""
    if result == "exit-code" and status.isdecimal():
        # If a signal ended the window, the compositor returns an exit code above 128, like a shell.
        code = int(status)
        return describe_exit(_SIGNAL_BASE - code if code > _SIGNAL_BASE else code)
    if result in ("signal", "core-dump"):
        return f"signal SIG{status.removeprefix('SIG')}"
    return _CAUSE_BY_RESULT.get(result, result)


def service_from_arguments(words: list[str]) -> str:
    """Returns the name of a service for operators: "window", "edge NAME", or "edge" for the default edge."""
    return " ".join(words if words[1:] != ["edge"] else words[:1])


def main(words: list[str]) -> int:
    """Records the end of a service. Always returns 0, because a failed record must not delay the restart."""
    cause = cause_from_systemd(os.environ)
    if words and cause:
        try:
            append_restart(RestartRecord(service_from_arguments(words), time.time(), cause))
        except EnlivenError as error:
            sys.stderr.write(f"enliven: {error}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
