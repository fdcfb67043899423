"""Opens the studio's window and types numbers into the fields; prints what came of it as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from imgui_bundle import hello_imgui, imgui

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from made_acting_stage import acting_stage

from enliven_viewer.studio.window import StudioWindow

said: dict[str, object] = {"done": False, "complaints": []}


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """A place as a sum, a height in centimetres, and what is no number."""
    workspace = window.workspace
    editor, figures = workspace.editor, workspace.figures
    ctx.yield_(4)
    editor.choose("post")
    ctx.yield_(4)
    for field, typed in (("place x", "1.2+0.3"), ("tall", "50 cm"), ("place y", "up")):
        ctx.item_click(f"//side/##{field}")
        ctx.key_chars_replace_enter(typed)
        ctx.yield_(3)
    said["place"], said["tall"] = float(figures.place[0]), float(figures.height)
    said["steps"] = list(editor.history.names)
    said["complaints"] = [toast.text for toast in editor.toasts.shown if toast.bad]
    said["done"] = True
    workspace.store.forget()
    window.close()


def main() -> None:
    window = StudioWindow(acting_stage(Path(sys.argv[1])))

    def register() -> None:
        engine = hello_imgui.get_imgui_test_engine()
        imgui.test_engine.get_io(engine).config_run_speed = imgui.test_engine.TestRunSpeed.fast
        test = imgui.test_engine.register_test(engine, "studio", "numbers")
        test.test_func = lambda ctx: work(ctx, window)
        imgui.test_engine.queue_test(engine, test)

    window.run(seconds=90, register_tests=register)
    print(json.dumps(said))


if __name__ == "__main__":
    main()
