"""Works in the studio's real window until it is killed, many times. Prints what the next window recovered.

    python tests/viewer/studio_window_killed.py FOLDER 50          # make test-long does this

Each window moves a shape slightly in each frame and prints the time. It is killed at a random time.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from coarse_pixels import coarse_pixels
from made_acting_stage import acting_stage

from enliven.modeling.edits import move_character
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.project_store import ProjectStore
from enliven_viewer.studio.workspace.workspace import Workspace

AUTOSAVE = 0.5
"""Seconds between two recovery files. A real studio waits 20, for which this test would take hours."""
STEP = 0.001
"""Metres per edit, so that the shape's position counts the edits."""
LONGEST = 4.0
"""Maximum seconds of work before a window is killed, enough for about eight recovery files."""


def place(project) -> float:
    """Returns the total shift of the shape to the right in metres."""
    return float(project.shapes["limb"].place[0])


def work(folder: Path) -> None:
    """Moves a shape in the real window for ever, and reports the time of each edit."""
    settings = StudioSettings(
        render=RenderSettings(shadow_size=64, contact_size=32, samples=1),
        width=700,
        height=520,
        autosave=AUTOSAVE,
    )
    project = acting_stage(folder / "made").editor.project
    workspace = Workspace.new(Editor(settings), folder)
    workspace.store.new(project)
    start, moved = place(project), [0]

    def before(window: StudioWindow) -> None:
        if window.pictures < 3:
            return
        workspace.editor.edit("move", lambda now: move_character(now, "limb", [STEP, 0.0, 0.0]))
        moved[0] += 1
        print(moved[0], time.monotonic(), start, flush=True)

    with coarse_pixels():
        StudioWindow(workspace).run(before=before, seconds=120)


def killed(folder: Path, chance: random.Random) -> dict[str, float]:
    """Lets a window work, kills it, and recovers its work. Returns the loss in edits and in seconds."""
    folder.mkdir(parents=True)
    command = [sys.executable, str(Path(__file__)), str(folder)]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert child.stdout is not None
    output = [child.stdout.readline()]
    time.sleep(chance.uniform(0.0, LONGEST))
    child.send_signal(signal.SIGKILL)
    output += child.stdout.readlines()
    child.wait()
    lines = [line.split() for line in output if line.endswith("\n") and len(line.split()) == 3]
    times = [float(lines[0][1]), *(float(line[1]) for line in lines)]
    editor = Editor()
    store = ProjectStore(editor, folder)
    recoverable = store.list_recoverable()
    if recoverable:
        store.recover(recoverable[0])
    kept = round((place(editor.project) - float(lines[0][2])) / STEP) if recoverable else 0
    store.close()
    lost, worked = times[-1] - times[min(kept, len(lines))], times[-1] - times[0]
    return {"told": len(lines), "kept": kept, "lost_s": lost, "worked_s": worked}


def main() -> None:
    folder = Path(sys.argv[1])
    if len(sys.argv) == 2:
        work(folder)
        return
    chance, results = random.Random(2), list[dict[str, float]]()
    for number in range(int(sys.argv[2])):
        results.append(killed(folder / str(number), chance))
    print(json.dumps({"results": results, "autosave": AUTOSAVE}))


if __name__ == "__main__":
    main()
