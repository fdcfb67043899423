"""Works in studios that are killed at random times. Prints what each next studio recovered.

A simulated clock advances 7 seconds per edit, so that a kill comes minutes into the work. Each studio is a
forked process, so that the modules are imported only once.
"""

from __future__ import annotations

import json
import os
import random
import signal
import sys
import time
from pathlib import Path

import numpy as np

from enliven.document.project import Project
from enliven.document.rigged import RiggedCharacter, still_shape
from enliven.document.skeleton import Skeleton
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.workspace.project_store import ProjectStore

KILLS = 50
"""Number of studios that are killed."""
TICK = 7.0
"""Seconds of the studio's clock between two edits. At this interval, at most two edits are lost."""
EDITS = 14
"""Maximum number of edits before a kill, enough for four recovery files."""
LONGEST = 0.01
"""Maximum time between the last edit and the kill, seconds. Writing a recovery file takes about as long."""


def bone(number: int) -> RiggedCharacter:
    """Returns a shape with a position that encodes the number of its edit."""
    places = np.random.default_rng(1).normal(0, 1, (40, 3))
    places[0] = number, 0.0, 0.0
    names = tuple(f"bone {k}" for k in range(40))
    return still_shape("bone", Skeleton(names, np.arange(-1, 39, dtype=np.int32), places))


def edited(project: Project) -> int:
    """Returns the number of the last edit in a project, 0 if there is none."""
    return int(round(project.shapes["bone"].skeleton.positions[0, 0])) if project.shapes else 0


def work(folder: Path, told: int) -> None:
    """Makes edits for ever, some seconds apart by the studio's own clock. Reports the number of each edit."""
    editor = Editor()
    store = ProjectStore(editor, folder)
    store.new()
    start = store.saved_at
    for number in range(1, 1 << 30):
        editor.edit("edit", lambda project, number=number: project.with_characters(bone(number)))
        store.autosave(start + number * TICK)
        store.settle()  # the simulated clock is a thousand times as fast as a disk
        os.write(told, number.to_bytes(4, "little"))


def killed(folder: Path, edits: int, moment: float) -> tuple[int, int]:
    """Lets a studio make ``edits`` edits and continue for ``moment`` seconds, and kills it.

    Returns:
        The last reported edit, and the last recovered one.
    """
    read, write = os.pipe()
    child = os.fork()
    if not child:
        os.close(read)
        work(folder, write)
    os.close(write)
    first = b"".join(os.read(read, 4) for _ in range(edits))
    time.sleep(moment)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    with os.fdopen(read, "rb") as rest:
        output = first + rest.read()
    editor = Editor()
    store = ProjectStore(editor, folder)
    recoverable = store.list_recoverable()
    if recoverable:
        store.recover(recoverable[0])
    recovered = edited(editor.project)
    store.close()
    return int.from_bytes(output[-4:], "little"), recovered


def main() -> None:
    folder, chance = Path(sys.argv[1]), random.Random(9)
    results = [killed(folder, chance.randint(1, EDITS), chance.uniform(0.0, LONGEST)) for _ in range(KILLS)]
    print(
        json.dumps({"results": results, "tick": TICK, "left": sorted(path.name for path in folder.iterdir())})
    )


if __name__ == "__main__":
    main()
