"""Opens the studio's window and works in the outliner. Prints the results as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from coarse_pixels import coarse_pixels
from deeds import scripted
from imgui_bundle import imgui

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from made_acting_stage import acting_stage

from enliven_viewer.studio.window.window import StudioWindow

report: dict[str, object] = {"done": False, "complaints": []}
ROW = "//outliner/**/##{}"
wanted: list[bool] = []
pictures: list[np.ndarray] = []


def picture(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> np.ndarray:
    """Returns the drawn viewport. The window's own context must be current."""
    wanted.append(True)
    ctx.yield_(2)
    left, top, wide, high = (round(number) for number in window.places.viewport)
    return pictures[-1][top : top + high, left : left + wide].astype(float)


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """Selects two rows, hides both by one eye, locks, renames in place, and drags a row."""
    workspace = window.workspace
    editor, handling = workspace.editor, lambda: workspace.editor.project.handling
    ctx.yield_(4)
    ctx.item_click(ROW.format("character star"))
    ctx.key_down(imgui.Key.mod_ctrl)
    ctx.item_click(ROW.format("character limb"))
    ctx.key_up(imgui.Key.mod_ctrl)
    ctx.yield_(2)
    report["several"] = list(editor.selection.characters)
    full_picture = picture(ctx, window)
    ctx.item_click("//outliner/**/" + "###eye limb")
    ctx.yield_(4)
    report["hidden"] = sorted(name for name, flags in handling().items() if flags.hidden)
    report["darker"] = float(np.abs(picture(ctx, window) - full_picture).mean())
    ctx.item_click("//outliner/**/" + "###lock post")
    report["locked"] = [name for name, flags in handling().items() if flags.locked]
    editor.select_only("limb")
    ctx.key_press(imgui.Key.f2)
    ctx.yield_(3)
    ctx.key_chars_replace_enter("wing")
    ctx.yield_(2)
    report["renamed"] = editor.selection.character
    ctx.item_drag_and_drop(ROW.format("character star"), ROW.format("character post"))
    ctx.yield_(2)
    report["order"] = list(editor.project.characters)
    report["complaints"] = [toast.text for toast in editor.toasts.shown if toast.is_error]
    report["done"] = True
    workspace.store.forget()
    window.close()


def main() -> None:
    window = StudioWindow(acting_stage(Path(sys.argv[1])))

    def after(window: StudioWindow) -> None:
        if wanted:
            wanted.clear()
            pictures.append(window.pixels())

    with coarse_pixels(lambda: bool(wanted)):
        window.run(seconds=300, register_tests=scripted(lambda ctx: work(ctx, window)), after=after)
    print(json.dumps(report))


if __name__ == "__main__":
    main()
