"""Opens the studio's window on a star, animates it with the example panel, and prints the results."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from coarse_pixels import coarse_pixels
from made_studio_puppets import project_with
from studio_driver import (
    Action,
    Click,
    Do,
    Drag,
    Key,
    Near,
    OnLane,
    OnPuppet,
    PerformerJoint,
    Wait,
    Widget,
    steps,
)
from studio_driver import actions as pace
from studio_driver.filming import WindowStage

from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

report: dict[str, object] = {}
STEP = pace.STEP = 0.12
"""Seconds per frame, three times as long as in a film."""


def work(workspace: Workspace) -> Iterator[Action]:
    """Chooses a take, pairs by hand and automatically, poses twice, retimes, changes a setting, and plays."""

    def star():
        return workspace.editor.project.puppets["star"]

    yield Wait(0.2)
    report["chosen"] = get_puppet_editor(workspace.editor).puppet is star()
    yield Click(Widget("takes"))
    yield Click(Widget("pick sway"))
    report["plays"] = [layer.take for layer in star().layers]
    yield Drag((Widget("grip"), Widget("filter")), 0.2)  # more space for the points
    yield Click(Widget("point head"))
    yield Click(PerformerJoint("bone 3"))
    report["paired"] = star().points[0].joint
    yield Click(Widget("foot"))
    report["foot"] = star().points[0].foot
    yield Click(Widget("foot"))
    yield Click(Widget("point head"))  # its fields are collapsed
    yield Click(Widget("guess joints"))
    report["joints"] = all(point.joint for point in star().points)
    yield Key("escape")
    for number in (1, 2):
        yield Click(Widget("suggested 1"))
        yield Wait(0.3)
        hand = OnPuppet("star", point=number)
        yield Drag((hand, Near(hand, 24, -30 * number)), 0.2)
    report["editing"] = get_puppet_editor(workspace.editor).number
    yield Click(Widget("pose Done"))
    yield Wait(1.0)
    get_puppet_editor(workspace.editor).motion_solver.settle(workspace.editor.project, "star")
    report["problem"] = str(get_puppet_editor(workspace.editor).motion_solver.problem("star"))
    report["poses"] = len(star().poses)
    first = min(star().poses, key=lambda pose: pose.time).time
    yield Drag((OnLane("poses", first), OnLane("poses", first + 0.2)), 0.2)
    report["retimed"] = min(pose.time for pose in star().poses) > first
    yield Click(Widget("key pose 1"))
    yield Click(Widget("pose Duplicate"))
    report["duplicated"] = len(star().poses)
    yield Click(Widget("pose Remove"))
    report["removed"] = len(star().poses)
    yield Key("space")
    yield Wait(0.4)
    yield Key("space")
    report["time"] = workspace.editor.time
    yield Click(Widget("point left"))
    yield Click(Widget("hold still"))
    report["held"] = len(star().layers[0].velocities)
    yield Click(Widget("all shapes"))
    report["left"] = get_puppet_editor(workspace.editor).puppet is None
    yield Click(Widget("character star"))
    report["again"] = get_puppet_editor(workspace.editor).puppet is star()
    yield Do(
        lambda workspace: report.update(bad=[t.text for t in workspace.editor.toasts.shown if t.is_error])
    )
    report["done"] = True


def main() -> None:
    render = RenderSettings(shadow_size=64, contact_size=32, samples=1)
    workspace = Workspace.new(
        Editor(StudioSettings(render=render, width=1000, height=660)), Path(sys.argv[1])
    )
    project = project_with("head", "left", "right", "foot")
    puppet = project.puppets["star"]
    bare = tuple(type(point)(point.name, point.vertex) for point in puppet.points)
    workspace.store.new(project.with_characters(puppet.with_changes(points=bare)))
    workspace.editor.select_only("star")
    workspace.input.activate_tool("puppet")
    window = StudioWindow(workspace, STEP)
    playing: list[tuple[WindowStage, Iterator[None]]] = []

    def before(window: StudioWindow) -> None:
        if window.pictures < 3:
            return
        if not playing:
            stage = WindowStage(window)
            stage.pace = 0.05
            playing.append((stage, steps(work(workspace), stage)))
        stage, going = playing[0]
        stage.settle()
        if next(going, StopIteration) is StopIteration:
            window.close()

    def after(window: StudioWindow) -> None:
        if window.pictures == 40:
            report["spread"] = float(window.pixels().std())

    with coarse_pixels(lambda: window.pictures == 40):
        window.run(before=before, after=after)
    print(json.dumps(report))


if __name__ == "__main__":
    main()
