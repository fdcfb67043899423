"""Opens the studio's window and saves, drops and films files like an artist. Prints the results."""

from __future__ import annotations

import ctypes
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import glfw
import numpy as np
from deeds import menu_path, scripted
from imgui_bundle import imgui
from imgui_bundle.glfw_utils import glfw_window_hello_imgui

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from coarse_pixels import coarse_pixels
from made_acting_stage import acting_stage

from enliven.document import RiggedCharacter
from enliven.exporters import exporter_of, sample_performance
from enliven.mapping.model_clips import find_played_clip
from enliven.sounds import SOUND_RATE, Sound
from enliven_viewer.studio.features.sound.sound_reader import read_sound
from enliven_viewer.studio.window.window import StudioWindow

report: dict[str, Any] = {"done": False}


def title() -> str:
    """Returns the title of the desktop window."""
    return glfw.get_window_title(glfw_window_hello_imgui())


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """Saves by Ctrl+S and Enter, changes the project, saves again, drops a mesh, and writes a film."""
    workspace = window.workspace
    ctx.yield_(3)
    report["at first"] = title()
    workspace.editor.select_only("limb")
    workspace.actions.do("shape.larger")
    ctx.yield_(3)
    report["changed"] = title()
    save(ctx, int(imgui.Key.s))
    report["saved"] = [title(), workspace.asking, Path("Untitled.enliven").is_file()]
    workspace.actions.do("shape.larger")
    save(ctx, int(imgui.Key.mod_shift) | int(imgui.Key.s), "squid")
    report["saved as"] = [title(), workspace.asking]
    workspace.store.save(Path("other.enliven"))
    save(ctx, int(imgui.Key.mod_shift) | int(imgui.Key.s), "squid")
    report["warns"] = [workspace.asking, bool(workspace.browser and workspace.browser.refusal)]
    ctx.key_press(imgui.Key.enter)
    ctx.yield_(3)
    report["replaced"] = [title(), workspace.asking]
    drop("limb.glb", "nothing.glb")
    ctx.yield_(3)
    report["dropped"] = sorted(workspace.editor.project.characters)
    choose_clip(ctx, window)
    report["told"] = [toast.text for toast in workspace.editor.toasts.shown if toast.is_error]
    report["recent"] = [Path(name).name for name in workspace.preferences.recent]
    film(ctx, window)
    ctx.menu_click(menu_path("File/Open recent/recent 1"))
    ctx.yield_(2)
    report["recent asks"] = workspace.asking
    workspace.continue_waiting_command(discard=True)
    ctx.yield_(3)
    report["opened"] = [title(), [Path(name).name for name in workspace.preferences.recent]]
    report["done"] = True


def choose_clip(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """Selects "no clip" for the dropped model, and then the clip again."""
    editor = window.workspace.editor
    dropped = editor.find_selected(RiggedCharacter)
    assert dropped is not None
    report["clip"] = [find_played_clip(editor.project, dropped)]
    for name in ("no clip", str(report["clip"][0])):
        ctx.item_click("//side/##clip")
        ctx.yield_(2)
        ctx.item_click(f"//$FOCUSED/###clip {name}")
        ctx.yield_(2)
        report["clip"].append(find_played_clip(editor.project, editor.project.shape(dropped.id)))


def save(ctx: imgui.test_engine.TestContext, key: int, name: str = "") -> None:
    """Presses Ctrl and a key, optionally types a name, and presses Enter."""
    ctx.key_press(int(imgui.Key.mod_ctrl) | key)
    ctx.yield_(3)
    if name:
        ctx.key_chars(name)
        ctx.yield_(2)
    ctx.key_press(imgui.Key.enter)
    ctx.yield_(3)


def drop(*paths: str) -> None:
    """Drops files like the desktop, through the window's own callback."""
    window = glfw_window_hello_imgui()
    called = glfw.set_drop_callback(window, None)
    glfw.set_drop_callback(window, called)
    names = [str(Path(path).resolve()).encode() for path in paths]
    called(window, len(names), (ctypes.c_char_p * len(names))(*names))


def film(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """Writes a film with sound from the menu, while the window continues."""
    workspace, pictures = window.workspace, window.pictures
    tone = (20_000 * np.sin(np.arange(SOUND_RATE) * 2 * np.pi * 440 / SOUND_RATE)).astype(np.int16)
    workspace.editor.edit("a sound", lambda project: project.with_sounds(Sound("tone", tone)))
    for name in ("star", "post"):
        workspace.editor.edit("delete", lambda project, name=name: project.drop_character(name))
    ctx.menu_click(menu_path("File/Film..."))
    ctx.yield_(3)
    ctx.key_press(imgui.Key.enter)
    end = time.monotonic() + 100
    ctx.yield_(2)
    while workspace.editor.background.busy and time.monotonic() < end:
        ctx.yield_()
    report["film"] = [path.name for path in Path().glob("*.mp4")]
    report["film told"] = [toast.text for toast in workspace.editor.toasts.shown]
    heard = read_sound(Path("squid.mp4")).samples.astype(float)
    report["heard"] = float(np.sqrt(2.0 * np.mean(heard**2)))
    report["went on"] = window.pictures - pictures > 10
    report["still drawn"] = None
    while report["still drawn"] is None and time.monotonic() < end:
        ctx.yield_()


def main() -> None:
    folder = Path(sys.argv[1])
    os.chdir(folder)
    workspace = acting_stage(folder / "own", 800, 520)
    workspace.preferences.recent.clear()
    limb = sample_performance(workspace.editor.project, workspace.editor.project.characters["limb"])
    exporter_of("limb.glb").write(Path("limb.glb"), [limb], "limb")
    window = StudioWindow(workspace)

    def guarded(ctx: imgui.test_engine.TestContext) -> None:
        try:
            work(ctx, window)
        finally:
            window.close()

    def after(window: StudioWindow) -> None:
        # The back buffer holds the image only until the swap.
        if "still drawn" in report and report["still drawn"] is None:
            report["still drawn"] = float(window.pixels().std())

    with coarse_pixels(lambda: report.get("still drawn", 0.0) is None):
        window.run(seconds=240, after=after, register_tests=scripted(guarded))
    print(json.dumps(report))


if __name__ == "__main__":
    main()
