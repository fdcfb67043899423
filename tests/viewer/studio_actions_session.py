"""Opens the studio's window and does every action of its table, once from its menu and once by its key.

Prints the results as JSON. A second argument is a folder for images.
"""

from __future__ import annotations

import itertools
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from imgui_bundle import imgui

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from coarse_pixels import coarse_pixels
from deeds import by_key, by_menu, menu_path, press, scripted
from made_acting_stage import NEEDS, acting_stage, ready_for

from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.features.outliner.outliner import Outliner
from enliven_viewer.studio.viewport.viewport import Viewport
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

report: dict[str, object] = {"done": False, "menu": [], "keys": [], "refused": {}, "complaints": []}
wanted: list[str] = []
SELDOM = 12
"""Number of window frames per drawn 3D image while menus and keys are tested."""

MOST_FRAMES = 600
"""Maximum number of window frames until typed letters arrive."""


def without_stage(workspace: Any) -> list[Action]:
    """Returns the actions that need no edge. perform_session.py does the others."""
    return [action for action in workspace.actions if "stage is" not in action.why_not()]


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """Does every action from its menu and by its key, and then tests the palette, other keys, and the
    history.
    """
    workspace = window.workspace
    workspace.editor.show_meshes = False  # meshes are hidden, because there are thousands of frames
    always = drawn_seldom()
    with coarse_pixels():
        tried(ctx, workspace)
    workspace.editor.show_meshes = True
    always()
    greyed(ctx, window)
    palette(ctx, window)
    keys(ctx, window)
    history(ctx, window)
    report["done"] = True
    workspace.store.forget()


def tried(ctx: imgui.test_engine.TestContext, workspace: Workspace) -> None:
    """Does every action from its menu, then by its key."""
    for name, way in (("menu", by_menu), ("keys", by_key)):
        for action in without_stage(workspace):
            if name == "keys" and not action.keys:
                continue
            ready_for(workspace, action)
            workspace.actions.recent.clear()
            way(ctx, action)
            if workspace.actions.recent == [action.id]:
                report[name].append(action.id)
            else:
                report["refused"][f"{name} {action.id}"] = action.why_not() or str(workspace.actions.recent)
            report["complaints"] += [toast.text for toast in workspace.editor.toasts.shown if toast.is_error]
            if workspace.state(Outliner).renaming:
                workspace.state(Outliner).renaming = ""
                ctx.yield_(3)  # the field releases the keys
            if workspace.asking:
                workspace.cancel()
                ctx.yield_()
            workspace.ended = False
            workspace.editor.background.finish()


def drawn_seldom() -> Callable[[], None]:
    """Draws the 3D image only occasionally, until the returned function is called."""
    draw, count = Viewport.draw, itertools.count()

    def seldom(self: Viewport, *args: Any, **how: Any) -> None:
        if next(count) % SELDOM == 0:
            draw(self, *args, **how)

    Viewport.draw = seldom
    return lambda: setattr(Viewport, "draw", draw)


def picture(ctx: imgui.test_engine.TestContext, name: str) -> None:
    """Writes an image of the current window."""
    ctx.yield_(3)
    wanted.append(name)
    ctx.yield_(2)


def greyed(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """Checks that an impossible action is grey, and that its tooltip gives the reason."""
    workspace = window.workspace
    workspace.editor.select(character=None)
    ctx.yield_(2)
    ctx.menu_action(imgui.test_engine.TestAction.hover, menu_path("Shape/Make a puppet"))
    ctx.sleep_no_skip(1.0, 0.1)  # a tooltip appears once the pointer rests
    picture(ctx, "greyed")
    press(ctx, "escape")
    press(ctx, "escape")


def wait_until(ctx: imgui.test_engine.TestContext, condition: Callable[[], bool]) -> bool:
    """Draws frames until the condition holds. Returns False if it does not hold after many frames."""
    for _ in range(MOST_FRAMES):
        ctx.yield_(1)
        if condition():
            return True
    return False


def search_for(ctx: imgui.test_engine.TestContext, window: StudioWindow, text: str) -> None:
    """Types a text into the palette and waits until the palette has all of it.

    The field takes letters only after it has the focus, and in a slow window, this takes several frames.
    """
    wait_until(ctx, lambda: imgui.get_io().want_text_input)
    ctx.key_chars(text)
    if not wait_until(ctx, lambda: window.workspace.finding.typed == text):
        report["complaints"].append(f"the palette has {window.workspace.finding.typed!r}, not {text!r}")


def palette(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """Finds an action by some letters, and does it by Enter."""
    workspace = window.workspace
    workspace.editor.show_bones = True
    press(ctx, "ctrl+k")
    search_for(ctx, window, "pup")
    report["found"] = [action.id for action in workspace.finding.matches][:4]
    picture(ctx, "palette")
    ctx.key_press(imgui.Key.enter)
    report["palette does"] = workspace.input.tool.name
    press(ctx, "ctrl+k")
    search_for(ctx, window, "examples")
    ctx.key_press(imgui.Key.enter)
    ctx.yield_(2)
    report["stays open"] = workspace.asking
    ctx.key_press(int(imgui.Key.mod_ctrl) | int(imgui.Key.a))
    search_for(ctx, window, "bones")
    ctx.key_press(imgui.Key.enter)
    ctx.yield_(2)
    report["palette"] = [workspace.asking, workspace.editor.show_bones]


def keys(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """Assigns another key to an action: first a free key, then another action's."""
    workspace = window.workspace
    actions, bones = workspace.actions, workspace.actions["view.bones"]
    workspace.open_dialogue("preferences")
    ctx.yield_(3)
    change_key(ctx, "view.bones", "j")
    report["free key"] = [actions.find_shortcuts(bones), workspace.wanted_key.key]
    change_key(ctx, "view.bones", "f")
    report["asked"] = [workspace.wanted_key.key, actions.find_shortcuts(bones)]
    picture(ctx, "keys")
    ctx.item_click("//###Preferences/###take")
    report["taken"] = [actions.find_shortcuts(bones), actions.find_shortcuts(actions["view.all"])]
    ctx.item_click("//###Preferences/###Close")
    ctx.yield_(2)
    workspace.editor.show_bones = True
    press(ctx, "f")
    report["by the new key"] = workspace.editor.show_bones
    actions.reset_shortcuts()
    workspace.open_dialogue("preferences")
    ctx.yield_(3)
    ctx.set_ref(ctx.window_info("//###Preferences/##keys").id_)
    ctx.item_click("\uf00d##no view.bones")
    ctx.set_ref("")
    report["freed"] = actions.find_shortcuts(bones)
    ctx.item_click("//###Preferences/###Close")
    actions.reset_shortcuts()
    picture(ctx, "window")
    workspace.open_dialogue("help")
    picture(ctx, "help")
    workspace.cancel()
    ctx.yield_(2)


def change_key(ctx: imgui.test_engine.TestContext, action_id: str, key: str) -> None:
    """Clicks on an action's key in the preferences, and presses another."""
    keys = ctx.window_info("//###Preferences/##keys").id_
    ctx.set_ref(keys)
    ctx.item_click(f"###key {action_id}")
    ctx.set_ref("")
    ctx.yield_(2)
    press(ctx, key)


def history(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """Clicks on an entry of the history."""
    workspace = window.workspace
    workspace.history_shown = True
    ctx.yield_(3)
    steps = len(workspace.editor.history.steps)
    ctx.item_click("//###History/###step 2")
    report["went to"] = [workspace.editor.history.current_step, steps == len(workspace.editor.history.steps)]
    picture(ctx, "history")


def main() -> None:
    workspace = acting_stage(Path(sys.argv[1]), *((1280, 720) if len(sys.argv) > 2 else (900, 520)))
    window = StudioWindow(workspace)

    def guarded(ctx: imgui.test_engine.TestContext) -> None:
        try:
            work(ctx, window)
        finally:
            window.close()

    def after(window: StudioWindow) -> None:
        while wanted:
            keep(wanted.pop(), window.pixels())

    window.run(seconds=380, after=after, register_tests=scripted(guarded))
    report["all"] = [[action.id, bool(action.keys)] for action in without_stage(workspace)]
    report["needs"] = sorted(NEEDS)
    report["pictures"] = window.pictures
    print(json.dumps(report))


def keep(name: str, pixels: np.ndarray) -> None:
    """Writes an image if a folder is given."""
    report.setdefault("spread", {})[name] = float(pixels.std())
    if len(sys.argv) > 2:
        from PIL import Image

        Image.fromarray(pixels).save(Path(sys.argv[2]) / f"{name}.png")


if __name__ == "__main__":
    main()
