"""Takes the tour in the real window, by hand or by "Show me". Prints its progress as JSON.

xvfb-run -a .venv/bin/python tests/viewer/studio_tour_session.py FOLDER hand|show [PICTURES [SIZE [TEXT]]]
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from coarse_pixels import coarse_pixels
from studio_driver import STEP, Action, Click, Do, Drag, Near, Pixel, Wait, Widget, steps, where
from studio_driver.filming import WindowStage

from enliven.overdub.possessed_overdub import has_motion
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.tour.feature import TourGuide
from enliven_viewer.studio.features.tour.tour import Tour
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

PATIENCE = 150.0
"""Timeout in seconds, including compilation of the kernels."""
CALM = 0.02
"""Seconds of sleep per frame while waiting for the stage, which needs the processor."""
LONG_STEP = 0.12
"""Seconds per frame if the image does not matter, so that animations of ticks, hands and views need few
frames.
"""
report: dict[str, object] = {"done": False, "outlines": [], "titles": [], "texts": []}
wanted: list[str] = []
stages: list[WindowStage] = []


def find_tour(workspace: Workspace) -> Tour | None:
    """Returns the running tour, or None without one."""
    return workspace.state(TourGuide).tour


def until(workspace: Workspace, done: Callable[[], object], what: str) -> Iterator[Action]:
    """Waits for a condition until a timeout of the wall clock."""
    end = time.monotonic() + PATIENCE
    while not done():
        if time.monotonic() > end:
            tour = find_tour(workspace)
            report["missing"] = [
                what,
                tour and [tour.number, tour.text, tour.done_display_s],
                [toast.text for toast in workspace.editor.toasts.shown],
                [
                    workspace.state(PerformSession).active_workspace,
                    workspace.state(PerformSession).stage_ids,
                    workspace.state(PerformSession).recording.phase,
                ],
            ]
            yield Do(lambda _: wanted.append("stuck"))
            yield Wait(0.1)
            raise TimeoutError(what)
        yield Do(lambda _: time.sleep(CALM))


def shot(name: str) -> Iterator[Action]:
    """Writes an image if a folder is given."""
    yield Do(lambda _: wanted.append(name))
    yield Wait(STEP)


def meets(workspace: Workspace, name: str, *, picture: bool = False) -> Iterator[Action]:
    """Waits for the outline around a part. Stores it, with the widget that it must enclose."""
    shown = lambda: "tour outline" in workspace.widgets  # noqa: E731
    if not picture:
        fits = lambda: shown() and name in find_tour(workspace).target.widgets  # noqa: E731
        yield from until(workspace, fits, f"the outline of {name}")
        yield Wait(3 * STEP)  # scrolling has finished by then
        there = workspace.widget(name)
    else:
        fits = lambda: shown() and find_tour(workspace).target.path  # noqa: E731
        yield from until(workspace, fits, f"the way in the picture to {name}")
        there = None
    report["outlines"].append([name, workspace.widgets["tour outline"], there])
    report["texts"].append(find_tour(workspace).text)
    yield from shot(f"{len(report['outlines']):02d} {name.replace('/', ' ')}")


def by_hand(workspace: Workspace) -> Iterator[Action]:
    """Does what a child would do after reading each sentence."""
    editor, perform = workspace.editor, workspace.state(PerformSession)
    yield from meets(workspace, "do Armchair")
    yield Click(Widget("do Armchair"))
    yield from meets(workspace, "recorded person")
    yield from press(workspace, "recorded person", lambda: perform.live is not None)
    yield from until(workspace, lambda: "stage state" in find_tour(workspace).target.widgets, "the waiting")
    yield Wait(0.5)
    yield from shot("02b waiting")
    yield from meets(workspace, "possess")
    yield Click(Widget("possess"))
    yield from until(workspace, lambda: perform.holders, "a dancer in the chair")
    yield from meets(workspace, "record")
    yield Click(Widget("record"))
    yield Wait(0.8)
    yield from shot("04b counting")
    yield from until(
        workspace, lambda: "the chair moves as the dancer moves" in find_tour(workspace).text, "the dance"
    )
    yield from shot("04c dancing")
    yield from until(workspace, lambda: "Stop" in find_tour(workspace).text, "enough of it")
    yield from meets(workspace, "record")
    yield Click(Widget("record"))
    yield from meets(workspace, "room Animate")
    yield Click(Widget("room Animate"))
    yield from meets(workspace, "tool cut")
    yield Click(Widget("tool cut"))
    yield from leave_and_resume(workspace)
    yield from meets(workspace, "the leg", picture=True)
    report["plays before"] = editor.playing
    yield from follow_the_arrow(workspace)
    yield from until(workspace, lambda: len(editor.project.graphs) == 2, "two parts")
    pieces = sorted(len(graph.mesh.vertices) for graph in editor.project.graphs.values())
    report["pieces"] = pieces
    report["plays after"] = editor.playing
    yield from meets(workspace, "tool carry")
    report["dance on"] = [has_motion(editor.project, graph) for graph in editor.project.graphs.values()]
    yield Click(Widget("tool carry"))
    yield from meets(workspace, "the piece", picture=True)
    yield from follow_the_arrow(workspace, shift=True)
    yield from until(workspace, lambda: len(editor.project.graphs) == 1, "one again")
    report["plays merged"] = editor.playing
    yield Wait(0.5)
    yield from shot("09b merged")
    if "menu all" in workspace.widgets:
        yield from meets(workspace, "menu all")
        yield Click(Widget("menu all"))
        yield Wait(0.2)
    yield from meets(workspace, "menu File")
    yield Click(Widget("menu File"))
    yield from meets(workspace, "menu File/Save")
    yield Click(Widget("menu File/Save"))
    yield from meets(workspace, "file name")
    yield Do(typed("Hopping chair"))
    yield Wait(0.3)
    yield from meets(workspace, "dialog Save")
    yield Click(Widget("dialog Save"))


def press(workspace: Workspace, name: str, done: Callable[[], object]) -> Iterator[Action]:
    """Clicks until ``done`` is true, because a busy window may miss a click."""
    end = time.monotonic() + PATIENCE
    while not done() and time.monotonic() < end:
        yield Click(Widget(name))
        for _ in range(20):
            if not done():
                yield Do(lambda _: time.sleep(CALM))


def typed(text: str):
    """Returns the action that types text into the focused field."""
    from imgui_bundle import imgui

    return lambda workspace: imgui.get_io().add_input_characters_utf8(text)


def leave_and_resume(workspace: Workspace) -> Iterator[Action]:
    """Leaves the tour in its middle, and resumes it from the menu."""
    yield from until(workspace, lambda: "tour later" in workspace.widgets, "the card")
    number = find_tour(workspace).number
    yield Click(Widget("tour later"))
    yield from until(workspace, lambda: find_tour(workspace) is None, "no tour")
    yield from open_menu(workspace, "menu Help")
    yield Click(Widget("menu Help/Take the tour"))
    yield from until(workspace, lambda: find_tour(workspace) is not None, "the tour again")
    report["resumed"] = [number, find_tour(workspace).number]


def open_menu(workspace: Workspace, name: str) -> Iterator[Action]:
    """Opens a menu. In a narrow window, it is in the combined menu."""
    if "menu all" in workspace.widgets:
        yield Click(Widget("menu all"))
        yield Wait(0.2)
    yield Click(Widget(name))
    yield Wait(0.2)


def follow_the_arrow(workspace: Workspace, *, shift: bool = False) -> Iterator[Action]:
    """Moves to the start of the arrow, where the chair is still, and drags along the arrow."""
    for _ in range(16):  # the view may still be moving
        yield Do(lambda _: stages[0].move(where(on_picture(workspace)[0], stages[0])))
    yield Wait(2 * STEP)
    report["holds still"] = report.get("holds still", True) and not workspace.editor.playing
    yield Drag(on_picture(workspace), 0.8, shift=shift)


def on_picture(workspace: Workspace) -> tuple[Near, ...]:
    """Returns the ends of the arrow as positions for the driver."""
    return tuple(Near(Pixel(0.0, 0.0), x, y) for x, y in find_tour(workspace).target.path)


def by_showing(workspace: Workspace) -> Iterator[Action]:
    """Presses "Show me" in each step."""
    number = -1
    while find_tour(workspace) is not None and find_tour(workspace).step is not None:
        tour = find_tour(workspace)
        if tour.number != number and tour.done_display_s <= 0.0 and not tour.is_demonstrating:
            number = tour.number
            yield Wait(2 * STEP)
            report["titles"].append(tour.title)
            yield Click(Widget("tour show"))
            yield Wait(0.7)
            yield from shot(f"show {number + 1}")
        yield from until(
            workspace,
            lambda: tour.step is None or (tour.number != number and tour.done_display_s <= 0.0),  # noqa: B023
            f"the end of step {number + 1}",
        )


def work(workspace: Workspace, how: str) -> Iterator[Action]:
    """Opens the start page, begins the tour by its button, and does each step."""
    yield Wait(0.3)
    yield from shot("00 start")
    yield Click(Widget("do Take the tour"))
    yield from (by_hand if how == "hand" else by_showing)(workspace)
    yield from until(
        workspace,
        lambda: (tour := find_tour(workspace)) and tour.step is None,
        "the end",
    )
    yield Wait(0.3)
    yield from shot("12 end")
    report["file"] = str(workspace.store.path)
    report["dirty"] = workspace.store.dirty
    yield Click(Widget("tour close"))
    yield Wait(0.2)
    report["closed"] = [
        find_tour(workspace) is None,
        workspace.preferences.toured,
        workspace.preferences.tour_step,
    ]
    yield Click(Widget("room Perform"))
    yield Wait(0.2)
    yield Click(Widget("leave"))
    yield Wait(0.2)
    report["left the stage"] = workspace.state(PerformSession).live is None
    report["toasts"] = [toast.text for toast in workspace.editor.toasts.shown if toast.is_error]
    report["done"] = True


def main() -> None:
    os.chdir(sys.argv[1])
    pictures = Path(sys.argv[3]) if len(sys.argv) > 3 else None
    width, height = map(int, (sys.argv[4] if len(sys.argv) > 4 else "1000x640").split("x"))
    small = RenderSettings(shadow_size=64, contact_size=32, samples=1)
    settings = StudioSettings(render=RenderSettings() if pictures else small, width=width, height=height)
    workspace = Workspace.new(Editor(settings), Path(sys.argv[1]) / "own")
    workspace.preferences.text_size = float(sys.argv[5]) if len(sys.argv) > 5 else 1.0
    workspace.starting = True
    window = StudioWindow(workspace, STEP if pictures else LONG_STEP)
    going: list[tuple[WindowStage, Iterator[None]]] = []

    def before(window: StudioWindow) -> None:
        if window.pictures < 3:
            return
        if not going:
            stage = WindowStage(window)
            stage.pace = 0.1
            stages.append(stage)
            going.append((stage, steps(work(workspace, sys.argv[2]), stage)))
        stage, todo = going[0]
        stage.settle()
        try:
            next(todo)
        except (StopIteration, TimeoutError):
            workspace.store.forget()
            window.close()

    def after(window: StudioWindow) -> None:
        while wanted:
            name = wanted.pop()
            if pictures is not None:
                from PIL import Image

                Image.fromarray(window.pixels()).save(pictures / f"{name}.png")

    with coarse_pixels(lambda: bool(wanted) and pictures is not None):
        window.run(before=before, after=after, seconds=380)
    print(json.dumps(report))


if __name__ == "__main__":
    main()
