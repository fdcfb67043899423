"""Opens the studio in German and shows workspaces and dialogs at 1360x820. Prints cut or overlapping letters
as JSON.

Arguments: a folder for preferences, and optionally a folder for images.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from drawn_text import Letters, cut_letters, drawn_letters, overlapping_letters
from made_acting_stage import acting_stage
from studio_layout_session import STATES

from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.workspace.workspace import Workspace

DIALOGS = ("preferences", "help", "palette", "unsaved")
SETTLED = 6
"""Frames until ImGui has laid out its contents."""


def show(workspace: Workspace, name: str) -> None:
    """Shows a workspace or a dialog."""
    workspace.asking = ""
    if name in DIALOGS:
        STATES["Animate"](workspace)
        workspace.asking = name
    else:
        STATES[name](workspace)


def main() -> None:
    pictures = Path(sys.argv[2]) if len(sys.argv) > 2 else None
    workspace = acting_stage(Path(sys.argv[1]), 1360, 820)
    shown = [*STATES, *DIALOGS]
    state = {"at": 0, "since": 0}
    lists: dict[str, list[Letters]] = {}
    widgets: dict[str, dict[str, list[str]]] = {"en": {}, "de": {}}

    def before(window: StudioWindow) -> None:
        if window.desktop is None:
            return
        if state["at"] == 2 * len(shown):
            workspace.store.forget()
            window.close()
        elif state["since"] == 0:
            workspace.preferences.set_language("de" if state["at"] >= len(shown) else "en")
            show(workspace, shown[state["at"] % len(shown)])
            workspace.widgets.clear()

    def after(window: StudioWindow) -> None:
        if window.desktop is None or state["at"] == 2 * len(shown):
            return
        state["since"] += 1
        if state["since"] < SETTLED:
            return
        language, name = ("en", "de")[state["at"] // len(shown)], shown[state["at"] % len(shown)]
        state.update(at=state["at"] + 1, since=0)
        widgets[language][name] = sorted(workspace.widgets)
        if language == "de":
            lists[name] = drawn_letters()
            if pictures is not None:
                from PIL import Image

                Image.fromarray(window.pixels()).save(pictures / f"{name}.png")

    StudioWindow(workspace).run(seconds=200, before=before, after=after)
    report = {
        name: {
            "letters": sum(len(letter.places) for letter in letters),
            "cut": cut_letters(letters),
            "overlapping": overlapping_letters(letters),
            "widgets": widgets["de"][name],
            "widgets in English": widgets["en"][name],
        }
        for name, letters in lists.items()
    }
    print(json.dumps(report))


if __name__ == "__main__":
    main()
