"""Updates the translation catalogues of the window after texts have changed.

The catalogues are viewer/enliven_viewer/locale/*.po.

.venv/bin/python scripts/texts.py          # adds new texts without a translation, removes obsolete ones
.venv/bin/python scripts/texts.py fr       # starts a catalogue for another language
"""

from __future__ import annotations

import ast
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import polib

from enliven.document import (
    ArapSettings,
    ExampleCharacter,
    ExampleSettings,
    GraphCharacter,
    LocomotionSettings,
    RiggedCharacter,
)
from enliven_viewer.language import CATALOGUES
from enliven_viewer.render.stage_look import LOOKS
from enliven_viewer.studio.app.workspace_tabs import WORKSPACES
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.features.puppets.solver_settings import SETTING_SLIDERS, get_description
from enliven_viewer.studio.workspace.workspace import Workspace

HOUSE = Path(__file__).parents[1]
VIEWER = HOUSE / "viewer" / "enliven_viewer"
WINDOW_FOLDERS = "studio", "live", "kiosk", "souvenirs"
"""Folders of the modules that draw the window."""
TRANSLATING_FUNCTIONS = {
    "tr": (0,),
    "tr_n": (0,),
    "draw_heading": (0,),
    "draw_note": (0,),
    "draw_tooltip": (0,),
    "draw_button": (1,),
    "draw_choice": (1, 2),
}
TRANSLATING_FUNCTIONS |= {"open_modal": (0,), "draw_switch": (1, 4), "draw_slider": (5,)}
TRANSLATING_FUNCTIONS |= {"Texts": (0,), "later": (0,)}
TRANSLATING_FUNCTIONS |= {
    "edit": (0,),
    "drop": (0,),
    "_edit": (0,),
    "_add": (0,),
    "_delete_selection": (0,),
    "_copy": (0,),
}
TRANSLATING_FUNCTIONS |= {"_store_ends": (1, 2), "change": (0,), "_edit_selection": (0,)}
"""Functions that translate the texts they show, with the argument positions of these texts."""
TEXT_TABLES = {"_TITLES", "_TAB_TIPS", "_MOUSE_ACTIONS", "_SIDE_TITLES"}
"""Names of tables of texts that are passed to a translating function."""
SETTINGS = {"surface": ArapSettings(), "examples": ExampleSettings(), "locomotion": LocomotionSettings()}
"""Settings of a puppet, which are numbers with tooltips."""
LINE_LENGTH = 78
"""Maximum number of characters of a line in a catalogue. It is the same as in gettext's programs."""
TEXT_FUNCTION_PREFIXES = ("hint", "describe_missing", "lacks", "why_not", "at_end")
"""Name prefixes of functions that return texts to be translated when they are shown.

The texts are hints of tools, or reasons."""


def find_constants(node: ast.AST) -> Iterator[ast.Constant]:
    """Yields the complete texts in an expression. Keys of a table and parts of another text are skipped."""
    if isinstance(node, ast.Constant):
        if isinstance(node.value, str) and any(letter.isalpha() for letter in node.value):
            yield node
    elif isinstance(node, ast.Dict):
        for value in node.values:
            yield from find_constants(value)
    elif isinstance(node, (ast.Tuple, ast.List)):
        for value in node.elts:
            yield from find_constants(value)
    elif isinstance(node, ast.IfExp):
        yield from find_constants(node.body)
        yield from find_constants(node.orelse)
    elif isinstance(node, ast.BoolOp):
        for value in node.values:
            yield from find_constants(value)


def find_displayed_texts(tree: ast.Module) -> Iterator[ast.Constant]:
    """Yields the texts of a module that are passed to a translating function."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            for place in TRANSLATING_FUNCTIONS.get(name, ()):
                if place < len(node.args):
                    yield from find_constants(node.args[place])
        elif isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if any(isinstance(target, ast.Name) and target.id in TEXT_TABLES for target in targets):
                yield from find_constants(node.value)
        elif isinstance(node, ast.FunctionDef) and node.name.lstrip("_").startswith(TEXT_FUNCTION_PREFIXES):
            for part in ast.walk(node):
                if isinstance(part, ast.Return) and part.value is not None:
                    yield from find_constants(part.value)


def list_modules() -> list[Path]:
    """Returns the modules that draw the window."""
    return sorted(path for room in WINDOW_FOLDERS for path in (VIEWER / room).rglob("*.py"))


def texts() -> dict[str, str]:
    """Returns every text that the window translates, with its file and line, or with its action."""
    places: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        workspace = Workspace.new(Editor(), Path(folder))
    for action in workspace.actions:
        for text in (action.menu, action.group, action.label, action.entry, action.about):
            if text:
                places.setdefault(text, f"action {action.id}")
    for name in (*WORKSPACES, *(tool.label for tool in workspace.input.tools.values())):
        places.setdefault(name, "workspaces and tools")
    for name in (GraphCharacter.word, ExampleCharacter.word, RiggedCharacter.word):
        places.setdefault(name, "characters")
    for look in LOOKS:
        places.setdefault(look, "looks")
    for group, name, *_ in SETTING_SLIDERS:
        places.setdefault(get_description(SETTINGS[group], name), f"setting {name}")
    for path in list_modules():
        for node in find_displayed_texts(ast.parse(path.read_text("utf-8"))):
            places.setdefault(node.value, f"{path.relative_to(HOUSE).as_posix()}:{node.lineno}")
    return places


def find_plurals() -> dict[str, str]:
    """Returns the singular texts, each with its plural text."""
    calls = (node for path in list_modules() for node in ast.walk(ast.parse(path.read_text("utf-8"))))
    return {
        str(ast.literal_eval(node.args[0])): str(ast.literal_eval(node.args[1]))
        for node in calls
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "tr_n"
    }


def is_translated(entry: polib.POEntry) -> bool:
    """Returns True if an entry of a catalogue has a translation for each of its forms."""
    return all(entry.msgstr_plural.values()) if entry.msgid_plural else bool(entry.msgstr)


def update(catalogue: polib.POFile, texts: dict[str, str]) -> None:
    """Adds missing texts to a catalogue, and removes texts that the window no longer has."""
    many = find_plurals()
    for entry in list(catalogue):
        if entry.msgid not in texts or entry.msgid_plural != many.get(entry.msgid, ""):
            catalogue.remove(entry)
    for text, place in texts.items():
        entry = catalogue.find(text)
        if entry is None:
            entry = polib.POEntry(msgid=text)
            if text in many:
                entry.msgid_plural, entry.msgstr_plural = many[text], {0: "", 1: ""}
            catalogue.append(entry)
        entry.comment = place.rpartition(":")[0] or place  # without the line, which other edits change
    catalogue.sort(key=lambda entry: (entry.comment, entry.msgid))


def main() -> None:
    """Updates every catalogue, and starts one for each language named on the command line."""
    for name in sys.argv[1:]:
        path = CATALOGUES / f"{name}.po"
        if not path.exists():
            begun = polib.POFile(wrapwidth=LINE_LENGTH)
            begun.metadata = {
                "Content-Type": "text/plain; charset=utf-8",
                "Content-Transfer-Encoding": "8bit",
                "Language": name,
                "Plural-Forms": "nplurals=2; plural=(n != 1);",
            }
            path.parent.mkdir(exist_ok=True)
            begun.save(str(path))
    places = texts()
    for path in sorted(CATALOGUES.glob("*.po")):
        catalogue = polib.pofile(str(path), wrapwidth=LINE_LENGTH)
        update(catalogue, places)
        catalogue.save(str(path))
        lacking = [entry for entry in catalogue if not is_translated(entry)]
        print(f"{path.name}: {len(catalogue)} texts, {len(lacking)} without a translation")
        for entry in lacking:
            print(f"  {places[entry.msgid]}: {entry.msgid!r}")


if __name__ == "__main__":
    main()
