"""Shows three workspaces in both themes, switched while the window is open. Prints colours as JSON.

Arguments: a folder for preferences, and optionally a folder for images.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from made_acting_stage import acting_stage
from studio_layout_session import ROOMS, enter

from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.theme import THEMES

SETTLED = 5
"""Number of frames until colours and panels have changed."""


def main() -> None:
    pictures = Path(sys.argv[2]) if len(sys.argv) > 2 else None
    workspace = acting_stage(Path(sys.argv[1]), 1360, 820)
    steps = [(theme, room) for theme in THEMES for room in ROOMS]
    state, report = {"at": 0, "since": 0}, {}

    def before(window: StudioWindow) -> None:
        if window.desktop is None:
            return
        if state["at"] == len(steps):
            workspace.store.forget()
            window.close()
        elif state["since"] == 0:
            theme, room = steps[state["at"]]
            workspace.preferences.set_colours(theme)
            enter(workspace, room, chosen=None if room == "Perform" else "limb")

    def after(window: StudioWindow) -> None:
        if window.desktop is None or state["at"] == len(steps):
            return
        state["since"] += 1
        if state["since"] < SETTLED:
            return
        pixels, places = window.pixels(), window.places
        side, stage = places.side, places.viewport
        column = pixels[
            round(side.y) : round(side.y + side.height), round(side.x) + 2 : round(side.x + side.width) - 2
        ].reshape(-1, 3)
        colours, counts = np.unique(column, axis=0, return_counts=True)
        common = colours[counts.argmax()].astype(int)
        corner = pixels[round(stage.y) + 70 : round(stage.y) + 130, round(stage.x) + 30 : round(stage.x) + 90]
        report[" ".join(steps[state["at"]])] = {
            "panel": common.tolist(),
            "stage": corner.reshape(-1, 3).mean(0).tolist(),
            "inks": int((np.abs(column.astype(int) - common).max(1) > 150).sum()),
        }
        if pictures is not None:
            from PIL import Image

            Image.fromarray(pixels).save(pictures / f"{' '.join(steps[state['at']])}.png")
        state.update(at=state["at"] + 1, since=0)

    window = StudioWindow(workspace)
    window.run(seconds=120, before=before, after=after)
    print(json.dumps(report))


if __name__ == "__main__":
    main()
