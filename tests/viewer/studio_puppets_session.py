"""Opens the studio's window on a star and works in it like an artist. Prints the results as JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from made_studio_puppets import studio, vertex
from studio_driver import (
    STEP,
    Action,
    Click,
    Do,
    Drag,
    Key,
    Near,
    OnPuppet,
    Spot,
    Wait,
    steps,
)
from studio_driver.filming import WindowStage

from enliven_viewer.studio.features.puppets.puppet_tool import PuppetTool
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

report: dict[str, object] = {"done": False}
pictures: dict[str, np.ndarray] = {}


def work(window: StudioWindow, wanted: list[str]) -> Iterator[Action]:
    """Adds points by clicks, and a key pose with its arrow handle. Shows the warning, undoes, and ends."""
    workspace = window.workspace
    snap = lambda name: Do(lambda _: wanted.append(name))  # noqa: E731
    yield Wait(0.1)
    yield Do(lambda d: d.input.tool.suggested.wait())
    steady: list[object] = []
    look = Do(lambda d: steady.append([workspace.widgets.get(name) for name in ("status", "next step")]))
    yield Wait(0.1)
    yield look
    for name in ("left", "right", "head", "foot"):
        yield Click(OnPuppet("star", vertex(name)))
        yield Wait(0.1)
        yield look
    report["points"] = len(get_puppet_editor(workspace.editor).puppet.points)
    yield Do(lambda d: d.editor.scrub(1.0))
    yield Click(OnPuppet("star", point=0))
    yield snap("chosen")
    tool = workspace.input.tool
    assert isinstance(tool, PuppetTool)
    manipulator = tool.manipulator()
    assert manipulator is not None
    tip = Spot(*(manipulator.place + np.array([0.0, 60.0, 0.0]) * manipulator.pixel))
    yield Drag((tip, Near(tip, 0, -50)), seconds=0.3)
    puppets = get_puppet_editor(workspace.editor)
    report["pose"] = [
        puppets.number,
        (get_puppet_editor(workspace.editor).places - get_puppet_editor(workspace.editor).puppet.rest)[
            0
        ].tolist(),
    ]
    yield snap("posed")
    yield look
    yield Do(
        lambda d: (
            get_puppet_editor(d.editor).drag(0, np.array([0.3, 0.45, 0.0])),
            get_puppet_editor(d.editor).drop(),
        )
    )
    yield Wait(0.5)
    yield Do(lambda d: get_puppet_editor(d.editor).self_intersection.wait())
    yield Wait(0.1)
    yield snap("warned")
    report["warning"] = tool.warning
    yield Key("ctrl+z")
    yield Key("enter")
    report["left"] = get_puppet_editor(workspace.editor).is_posing
    yield Wait(0.1)
    yield look
    report["steady"], report["column"] = steady, list(window.places.side)
    yield Key("space")
    yield Wait(0.2)
    report["playing"] = workspace.editor.playing
    yield Wait(0.1)
    report["bad"] = [toast.text for toast in workspace.editor.toasts.shown if toast.is_error]
    report["done"] = True


def main() -> None:
    workspace: Workspace = studio(Path(sys.argv[1]), take="sway")[0]
    window = StudioWindow(workspace, STEP)
    wanted: list[str] = []
    stages: list[WindowStage] = []
    going: list[Iterator[None]] = []

    def before(window: StudioWindow) -> None:
        if window.pictures < 3:
            return
        if not going:
            stages.append(WindowStage(window))
            stages[0].pace = 0.1
            going.append(steps(work(window, wanted), stages[0]))
        stages[0].settle()
        if next(going[0], StopIteration) is StopIteration:
            workspace.store.forget()
            window.close()

    def after(window: StudioWindow) -> None:
        while wanted:
            pictures[wanted.pop()] = window.pixels()

    window.run(before=before, after=after, seconds=150)
    changed = np.abs(pictures["posed"].astype(int) - pictures["chosen"]).max(2) > 30
    red = pictures["warned"].astype(int)
    warning = (red[..., 0] > 200) & (red[..., 1] < 110) & (red[..., 2] < 110)
    report["changed"], report["red"] = int(changed.sum()), int(warning.sum())
    if len(sys.argv) > 2:
        from PIL import Image

        for name, picture in pictures.items():
            Image.fromarray(picture).save(Path(sys.argv[2]) / f"star_{name}.png")
    print(json.dumps(report))


if __name__ == "__main__":
    main()
