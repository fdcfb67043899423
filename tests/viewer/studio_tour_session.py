"""Takes the tour in the real window, from the start page on; prints how far it came as JSON."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from coarse_pixels import coarse_pixels
from strokes import limb
from studio_driver import (
    STEP,
    Action,
    Click,
    Do,
    Drag,
    JointPlace,
    Key,
    OnBone,
    Pixel,
    SourceJoint,
    Spot,
    Wait,
    Widget,
    steps,
)
from studio_driver.filming import WindowStage

from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

said: dict[str, object] = {"done": False, "steps": []}
wanted: list[str] = []


def deeds(workspace: Workspace) -> Iterator[list[Action]]:
    """What each step of the tour asks for."""
    way = limb(np.array([[0.0, 0.0], [0.0, -0.45], [0.0, -0.9]]), np.array([0.07, 0.05, 0.03]))
    outline = tuple(Spot(x + 0.1, y + 1.4) for x, y in way[:: max(len(way) // 24, 1)])
    yield [Key("1"), Wait(0.8), Key("s"), Drag((*outline, outline[0]), 2.0)]
    yield [Drag((Pixel(0.2, 0.3), Pixel(0.3, 0.34)), 0.6, button=2 - 1), Key("1"), Wait(0.6)]
    name = next(iter(workspace.editor.project.characters))
    yield [Key("i"), Click(OnBone(name, 1, 0.5))]
    ends = [Click(SourceJoint(k)) for k in (0, 6)] + [Click(JointPlace(name, k)) for k in (0, 2)]
    yield [Click(Widget("take wave")), Wait(0.2), *ends]
    yield [Key("space"), Wait(0.5), Key("space"), Key("home")]
    yield [Key("q"), Click(OnBone(name, 1, 0.5)), Key("ctrl+d")]
    yield [Key("f"), Wait(0.8), Key("g"), Drag((JointPlace(f"{name} 2", 0), JointPlace(name, 2)), 1.0)]
    yield [Key("ctrl+z")]
    yield [Key("ctrl+k"), Wait(0.2), Do(typed("larger")), Wait(0.2), Key("enter")]
    yield [Key("ctrl+s"), Wait(0.3), Key("enter")]


def typed(text: str):  # type: ignore[no-untyped-def]
    """What types letters into the field that has the focus."""
    from imgui_bundle import imgui

    return lambda workspace: imgui.get_io().add_input_characters_utf8(text)


def work(workspace: Workspace) -> Iterator[Action]:
    """The start page, the tour by its button, and the deed of each step."""
    yield Wait(0.3)
    yield Do(lambda _: wanted.append("start"))
    yield Wait(0.1)
    yield Click(Widget("do Take the tour"))
    yield Wait(0.2)
    doing = deeds(workspace)
    while workspace.tour is not None and workspace.tour.step is not None:
        number, title = workspace.tour.number, workspace.tour.step.title
        yield Do(lambda _, number=number: wanted.append(f"step {number + 1}"))
        yield Wait(0.1)
        said["at"] = title
        yield from next(doing)
        for _ in range(80):
            if workspace.tour is None or workspace.tour.number != number:
                break
            yield Wait(0.1)
        else:
            said["stuck"] = [title, [toast.text for toast in workspace.editor.toasts.shown]]
            yield Do(lambda _: wanted.append("stuck"))
            yield Wait(0.1)
            return
        said["steps"].append(title)
    yield Do(lambda _: wanted.append("after"))
    yield Wait(0.1)
    said["done"] = True


def main() -> None:
    os.chdir(sys.argv[1])
    render = RenderSettings(shadow_size=64, contact_size=32, samples=1)
    size = (1280, 720) if len(sys.argv) > 2 else (1000, 620)
    settings = StudioSettings(render=render, width=size[0], height=size[1])
    workspace = Workspace.new(Editor(settings), Path(sys.argv[1]))
    workspace.starting = True
    window = StudioWindow(workspace, STEP)
    going: list[tuple[WindowStage, Iterator[None]]] = []

    def before(window: StudioWindow) -> None:
        if window.pictures < 3:
            return
        if not going:
            stage = WindowStage(window)
            stage.pace = 0.1
            going.append((stage, steps(work(workspace), stage)))
        stage, todo = going[0]
        stage.settle()
        if next(todo, StopIteration) is StopIteration:
            workspace.store.forget()
            window.close()

    def after(window: StudioWindow) -> None:
        while wanted:
            name = wanted.pop()
            pixels = window.pixels()
            said[f"spread {name}"] = float(pixels.std())
            if len(sys.argv) > 2:
                from PIL import Image

                Image.fromarray(pixels).save(Path(sys.argv[2]) / f"{name}.png")

    with coarse_pixels(lambda: bool(wanted)):
        window.run(before=before, after=after, seconds=380)
    said["toured"] = workspace.preferences.toured
    print(json.dumps(said))


if __name__ == "__main__":
    main()
