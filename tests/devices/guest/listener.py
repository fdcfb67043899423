"""An edge's controls in a process of an ordinary user. Each line of output states an event and its time."""

from __future__ import annotations

import json
import logging
import os
import sys
import threading
import time
from pathlib import Path

from enliven_edge.controls.control_set import Controls, open_readers
from enliven_edge.controls.panel_protocol import Lamps
from enliven_edge.controls.settings import ControlSettings


def say(*what: object) -> None:
    print(json.dumps([time.monotonic(), *what]), flush=True)


def main() -> None:
    """Listens to the controls of a JSON file until the file is deleted."""
    logging.basicConfig(level=logging.INFO, stream=sys.stderr)
    wanted = Path(sys.argv[1])
    settings = {name: ControlSettings(**given) for name, given in json.loads(wanted.read_text()).items()}
    missing = set(settings)
    readers = open_readers(settings)
    with Controls(readers) as controls:
        say("listens", os.getuid())
        looked = 0.0
        while wanted.exists():
            now = set(controls.missing)
            for name in sorted(now ^ missing):
                say("gone" if name in now else "there", name)
            missing = now
            controls.show(Lamps(possess="steady"))
            for control in readers:
                for word in control.poll():
                    say("word", control.name, word)
            if time.monotonic() > looked + 0.5:
                looked = time.monotonic()
                say("holds", len(os.listdir("/proc/self/fd")), threading.active_count(), time.process_time())
            time.sleep(0.01)
    say("ended", threading.active_count())


if __name__ == "__main__":
    main()
