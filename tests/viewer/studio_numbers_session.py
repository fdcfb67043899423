"""Opens the studio's window and types numbers into the fields. Prints the results as JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from coarse_pixels import coarse_pixels
from deeds import scripted
from imgui_bundle import imgui

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from made_acting_stage import acting_stage

from enliven_viewer.studio.window.window import StudioWindow

report: dict[str, object] = {"done": False, "complaints": []}


def work(ctx: imgui.test_engine.TestContext, window: StudioWindow) -> None:
    """Types a position as a sum, a height in centimetres, and a text that is not a number."""
    workspace = window.workspace
    editor, figures = workspace.editor, workspace.selection_transform
    ctx.yield_(4)
    editor.select_only("post")
    ctx.yield_(4)
    for field, typed in (("place x", "1.2+0.3"), ("tall", "50 cm"), ("place y", "up")):
        ctx.item_click(f"//side/##{field}")
        ctx.key_chars_replace_enter(typed)
        ctx.yield_(3)
    report["place"], report["tall"] = float(figures.place[0]), float(figures.height)
    report["steps"] = list(editor.history.names)
    report["complaints"] = [toast.text for toast in editor.toasts.shown if toast.is_error]
    report["done"] = True
    workspace.store.forget()
    window.close()


def main() -> None:
    window = StudioWindow(acting_stage(Path(sys.argv[1])))

    with coarse_pixels():
        window.run(seconds=300, register_tests=scripted(lambda ctx: work(ctx, window)))
    print(json.dumps(report))


if __name__ == "__main__":
    main()
