"""Performs in the real window with a real edge, which is killed and restarted. Prints the results."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from imgui_bundle import ImVec2, imgui
from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from coarse_pixels import coarse_pixels
from deeds import by_key, by_menu, press, scripted
from strokes import limb

from enliven.modeling.edits import cut_character, handle_characters, scale_character
from enliven.modeling.mesh.cut_surfaces import PlaneCut
from enliven.modeling.sketching.sketch import shape_from_stroke
from enliven_viewer.live.possession_choice import PART_CHOICES
from enliven_viewer.settings import RenderSettings
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.settings import StudioSettings
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

EDGE = Path(__file__).parents[1] / "system" / "staged_edge.py"
PATIENCE = 150.0
"""Timeout in seconds, including compilation of the kernels."""
CLICKS = 3
"""Number of clicks on a menu entry: a slow frame sometimes closes a menu under the pointer."""
RECORDING = (
    "perform.record_or_end_the_recording",
    "perform.record_again_from_where_it_began",
    "perform.record_beside_what_was_recorded_last",
)
TAKE_OFF = "perform.take_the_chosen_character_from_the_stage"
"""The actions that are done last, one after the other, because they change the recording and the stage."""
AGAIN = 5.0
"""Seconds until the artist tries again. An edge that compiles is silent or refuses."""
PAUSE = 0.02
"""Seconds between two polls, so that the edge gets processor time."""
report: dict[str, object] = {"done": False}
wanted: list[str] = []


class RealEdge:
    """The program of staged_edge.py, which can be killed and restarted at its ports."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.ports = folder, list[str]()
        self.start()

    def start(self) -> None:
        words = [sys.executable, str(EDGE), f"stage-{time.time_ns()}", str(self.folder), "100", *self.ports]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.ports = self.process.stdout.readline().split()

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow, edge: RealEdge) -> None:
    """Plays an artist's actions, and the edge's failures during them."""
    workspace = window.workspace
    editor, perform = workspace.editor, workspace.state(PerformSession)

    def until(done: Callable[[], object], what: str, ask: Callable[[], object] = lambda: None) -> None:
        report["waits for"] = what
        end, asked = time.monotonic() + PATIENCE, -AGAIN
        while not done():
            if time.monotonic() - asked > AGAIN and perform.connected:
                ask()
                asked = time.monotonic()
                report["asked"] = [what, workspace.actions.recent[:2]]
            if time.monotonic() > end:
                toasts = [toast.text for toast in editor.toasts.shown]
                edge = perform.live and perform.live.document.edge.message
                state = [perform.connected, perform.recording.phase, perform.stage_ids, perform.holders, edge]
                state += [
                    perform.active_workspace,
                    perform.target,
                    workspace.asking,
                    workspace.actions.recent,
                ]
                state.append(imgui.get_io().want_text_input)
                report["missing"] = [what, perform.staged.sender.states, toasts, state]
                raise TimeoutError(what)
            ctx.yield_()
            time.sleep(PAUSE)

    def click(name: str) -> None:
        workspace.drawn.set_targets((name,))
        ctx.yield_(3)
        workspace.drawn.set_targets(())
        left, top, right, bottom = workspace.widget(name)
        ctx.mouse_move_to_pos(ImVec2(min((left + right) / 2, left + 40), (top + bottom) / 2))
        ctx.mouse_click(0)
        ctx.yield_()

    def shot(name: str) -> None:
        wanted.append(name)
        until(lambda: not wanted, "a picture")

    def recording(seconds: float) -> bool:
        # On a loaded machine, the edge may be silent for long enough to end a recording.
        if perform.recording.phase == "idle" and perform.connected:
            perform.recording.toggle()
        return perform.recording.recorder.seconds > seconds

    click("room Perform")
    ctx.item_input_value("perform/##address", ":".join(["127.0.0.1", *edge.ports]))
    until(lambda: perform.holders and perform.performers, "somebody who holds the chair")
    report["words"] = [holder.description for holder in perform.holders]
    shot("held")
    close_by(ctx, window, until, shot)
    click("waits arm")
    retry = lambda: None if perform.staged.sender.states.get("arm") else click("put")  # noqa: E731
    until(lambda: "arm" in perform.stage_ids, "the arm on the stage", retry)
    tall = np.ptp(perform.live.document.characters["arm"].vertices[:, 1])
    editor.edit("scale arm", lambda project: scale_character(project, "arm", 1.25))
    began = time.monotonic()
    until(lambda: np.ptp(perform.live.document.characters["arm"].vertices[:, 1]) > 1.1 * tall, "the edit")
    report["edit_s"] = time.monotonic() - began
    perform.recording.count_in = False
    record = lambda: click("record") if perform.recording.phase == "idle" else None  # noqa: E731
    until(lambda: perform.recording.recorder.seconds > 0.8, "a second of recording", record)
    report["growing"] = list(perform.recording.clip)
    shot("recording")
    ctx.key_press(int(imgui.Key.mod_ctrl) | int(imgui.Key.r))
    ctx.yield_()
    chair = editor.project.graphs.get("chair")
    report["recorded"] = [sorted(editor.project.characters), list(editor.project.bodies), editor.playing]
    report["solvable"] = chair is not None and chair.parts[0].possession is not None
    shot("recorded")
    ctx.key_press(int(imgui.Key.mod_ctrl) | int(imgui.Key.z))
    ctx.yield_()
    report["undone"] = [sorted(editor.project.characters), editor.history.redo_name]
    ctx.key_press(int(imgui.Key.mod_ctrl) | int(imgui.Key.mod_shift) | int(imgui.Key.z))
    ctx.yield_()
    before = [perform.recording.recorder.newest_ns, len(editor.project.takes)]
    until(lambda: recording(0.8), "a second recording")
    edge.kill()
    until(lambda: perform.recording.phase == "idle", "the end of the recording")
    report["kept"] = [len(editor.project.takes) - before[1], [t.text for t in editor.toasts.shown]]
    shot("gone")
    edge.start()
    until(lambda: perform.connected and perform.holders and "arm" in perform.stage_ids, "all of it again")
    report["undone both"] = editor.history.names[-2:]
    until(lambda: recording(0.8), "a third recording")
    perform.recording.toggle()
    report["takes"] = [name for name in editor.project.takes if name.startswith("take")]
    layered(ctx, window, until, recording)
    click("stands arm")
    report["each"] = each_action(ctx, window, until)
    click("room Play")
    shot("play")
    report["done"] = True
    workspace.store.forget()
    window.close()


def close_by(
    ctx: imgui.test_engine.TestContext,
    window: StudioWindow,
    until: Callable,
    shot: Callable[[str], None],
) -> None:
    """Releases the chair. The view moves to the legs that would be attached next, and back afterwards."""
    perform, camera = window.workspace.state(PerformSession), window.workspace.editor.camera
    until(lambda: not perform.holders, "a chair that is free", lambda: ctx.key_press(int(imgui.Key.r)))
    before = camera.goal
    press(ctx, "3")
    ctx.key_press(int(imgui.Key.c))
    until(lambda: perform.close_up.box is not None and "side view" in window.workspace.widgets, "the legs")
    shot("close up")
    near = camera.goal
    press(ctx, "1")
    until(lambda: perform.holders, "who holds the chair again", lambda: ctx.key_press(int(imgui.Key.p)))
    until(lambda: perform.close_up.box is None, "the view of before")
    ctx.key_press(int(imgui.Key.c))
    report["close"] = [near[5] < 0.9 * before[5], camera.goal == before, perform.close_up.is_on]


def layered(
    ctx: imgui.test_engine.TestContext,
    window: StudioWindow,
    until: Callable,
    recording: Callable[[float], bool],
) -> None:
    """Possesses the selected arm, records it, and records again during playback. The arm is cut in
    between.
    """
    editor, perform = window.workspace.editor, window.workspace.state(PerformSession)
    editor.select_only("arm")
    until(
        lambda: perform.staged.sender.states.get("arm") == "on the stage" and perform.target == "arm",
        "the arm",
    )
    live, counts, shown = perform.live, [], list[object]()
    assert live is not None
    live.choose_parts(PART_CHOICES.index("legs"))
    plane = PlaneCut(np.array([-0.8, 0.7, 0.0]), np.array([0.0, -1.0, 0.0]))
    for seconds in (0.8, 0.6):
        if counts:
            editor.edit("cut", lambda project: cut_character(project, "arm", plane, editor.time)[0])
            bones = len(editor.project.shapes["arm"].skeleton)
            until(lambda: len(live.document.characters["arm"].pivots) == bones, "the cut arm there")  # noqa: B023
        holds = lambda: "arm" in {holder.character for holder in perform.holders}  # noqa: E731
        until(holds, "who holds the arm", lambda: ctx.key_press(int(imgui.Key.p)))
        # While the edge prepares the cut arm, the project's arm is shown instead.
        until(lambda: recording(seconds) and "arm" in perform.hidden, "a recording of the arm")  # noqa: B023
        shown.append([sorted(perform.hidden), [actor.character.id for actor in perform.scene.actors]])
        perform.recording.toggle()
        counts.append(len({layer.take for layer in editor.project.shapes["arm"].layers}))
    report["layered"], report["shown once"] = counts, shown


def each_action(
    ctx: imgui.test_engine.TestContext, window: StudioWindow, until: Callable
) -> dict[str, list[str]]:
    """Does every stage action once from its menu and once by its key. Returns the refused actions."""
    workspace, refused = window.workspace, dict[str, list[str]]()
    recording = workspace.state(PerformSession).recording
    stage = [action for action in workspace.actions if action.id.startswith("perform.")]
    last = [action for action in stage if action.id in RECORDING or action.id == TAKE_OFF]
    alone = [action for action in stage if action not in last]
    steps = [(action, way) for action in alone for way in (by_menu, by_key)[: 1 + bool(action.keys)]]
    record, again, beside = (workspace.actions[action_id] for action_id in RECORDING)
    steps += [(record, by_menu), (record, by_key), (again, by_menu), (record, by_key)]
    steps += [(beside, by_menu), (record, by_key), (beside, by_key), (record, by_menu)]
    steps.append((workspace.actions[TAKE_OFF], by_menu))
    for action, way in steps:
        workspace.state(PerformSession).active_workspace = (action.workspaces or ("Play",))[-1]
        workspace.actions.recent.clear()
        workspace.editor.select(character="arm")
        if "own_size" in action.id:
            larger = lambda project: handle_characters(project, ["arm"], size=1.2)  # noqa: E731
            workspace.editor.edit("size", larger)
        elif action.id in RECORDING:
            workspace.editor.marked_range = None
            if recording.phase != "idle":
                until(lambda: recording.recorder.seconds > 0.4, "something that is recorded")
            # If the stage was busy, nothing moved, so it is recorded again.
            until(lambda: not action.why_not(), f"what {action.id} needs", recording.toggle)  # noqa: B023
        why_not = action.why_not()
        for _ in range(CLICKS):
            way(ctx, action)
            ctx.yield_(1)
            if workspace.actions.recent:
                break
        if workspace.actions.recent != [action.id]:
            outcome = f"{way.__name__}: {why_not or workspace.actions.recent}"
            refused.setdefault(action.id, []).append(outcome)
    return refused


def main() -> None:
    folder = Path(sys.argv[1])
    edge = RealEdge(folder)
    render = RenderSettings(shadow_size=64, contact_size=32, samples=1)
    large = len(sys.argv) > 2
    settings = StudioSettings(render=render, width=1280 if large else 900, height=720 if large else 640)
    workspace = Workspace.new(Editor(settings), folder)
    pill = limb(np.array([[0.0, 0.6], [-0.05, 0.3], [-0.2, 0.0]]), np.array([0.09, 0.06, 0.045]))
    arm = shape_from_stroke(np.add(pill, [-0.8, 0.5]), id="arm")
    workspace.store.new(workspace.editor.project.with_characters(arm))
    window = StudioWindow(workspace)

    def after(window: StudioWindow) -> None:
        while wanted:
            name = wanted.pop()
            if len(sys.argv) > 2:
                Image.fromarray(window.pixels()).save(Path(sys.argv[2]) / f"{name}.png")
        if "missing" in report:
            workspace.store.forget()
            window.close()

    try:
        with coarse_pixels(lambda: large):
            window.run(seconds=600, after=after, register_tests=scripted(lambda ctx: work(ctx, window, edge)))
    finally:
        edge.kill()
    print(json.dumps(report, default=str))


if __name__ == "__main__":
    main()
