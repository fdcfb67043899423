"""Tests of the window in German: texts of menus, actions, tools and tooltips are translated and fit."""

from __future__ import annotations

import ast
import importlib.util
import re
from pathlib import Path

import polib
import pytest
from in_a_window import in_a_window
from untranslated_texts import find_untranslated

from enliven_viewer.language import (
    CATALOGUES,
    LANGUAGES,
    Texts,
    language_in_use,
    later,
    set_language,
    tr,
    tr_n,
)
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.preferences import Preferences
from enliven_viewer.studio.workspace.workspace import Workspace

SESSION = Path(__file__).parents[1] / "studio_german_session.py"
SCRIPT = Path(__file__).parents[3] / "scripts" / "texts.py"


@pytest.fixture(scope="module")
def script():
    spec = importlib.util.spec_from_file_location("texts_of_the_window", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("language", [code for code in LANGUAGES if code != "en"])
def test_every_text_has_a_translation(script, language) -> None:
    texts, catalogue = script.texts(), polib.pofile(str(CATALOGUES / f"{language}.po"))
    is_translated = {entry.msgid: script.is_translated(entry) for entry in catalogue}
    lacking = [f"{place}: {text!r}" for text, place in texts.items() if not is_translated.get(text)]
    assert not lacking, f"{language} lacks texts; run scripts/texts.py and translate:\n" + "\n".join(lacking)
    obsolete = sorted(set(is_translated) - set(texts))
    assert not obsolete, f"{language} has texts that the window has no more; run scripts/texts.py: {obsolete}"
    assert len(texts) > 1200


def forms(entry: polib.POEntry) -> list[str]:
    """Returns the translations of an entry: one, or one for each plural form."""
    return list(entry.msgstr_plural.values()) if entry.msgid_plural else [entry.msgstr]


@pytest.mark.parametrize("language", [code for code in LANGUAGES if code != "en"])
def test_translations_keep_values_keys_and_the_sentence_that_is_the_title(language) -> None:
    for entry in polib.pofile(str(CATALOGUES / f"{language}.po")):
        place = f"{entry.comment}: {entry.msgid!r}"
        for pattern in (r"\{\d[^}]*\}", r"%\.?\d*[fd]", r"Ctrl\+\w\b", r"\((?:[A-Z]|Ctrl\+\w|Shift\+\w)\)"):
            values = sorted(re.findall(pattern, entry.msgid))
            for translated in forms(entry):
                assert sorted(re.findall(pattern, translated)) == values, place
        # The text up to the first full stop is the title. The rest is the advice.
        assert all((". " in entry.msgid) == (". " in translated) for translated in forms(entry)), place


def test_the_script_finds_each_way_in_which_a_text_is_shown(script) -> None:
    module = """
_TAB_TIPS = {"Play": "Only the picture"}
draw_heading("A title")
draw_button(workspace, "Press me")
draw_choice(workspace, "Yes" if new else "Keep", "No")
names = Texts({"dark": "Dark theme"})
said = tr("{0} of all", number)
class Tool:
    def hint(self):
        return "Click it."
    def _lacks_shape(self):
        return "" if self.shape else "No shape is chosen."
    def describe_missing_undo(self):
        return "" if self.undo_name else "Nothing is left to undo."
    def other(self):
        return "not shown"
"""
    assert {text.value for text in script.find_displayed_texts(ast.parse(module))} == {
        *("Only the picture", "A title", "Press me", "Yes", "Keep", "No", "Dark theme", "{0} of all"),
        *("Click it.", "No shape is chosen.", "Nothing is left to undo."),
    }


def test_a_text_that_keeps_its_values_is_translated_where_it_is_drawn() -> None:
    step = later("delete {0}", later("{0} shapes", 2))
    assert step == "delete 2 shapes" and tr(step) == step
    set_language("de")
    assert step == "delete 2 shapes" and tr(step) == "2 Figuren löschen"
    assert tr(later("Undone: {0}"), "x") == "Rückgängig: x"


@pytest.mark.slow
def test_every_shown_text_is_translated(script) -> None:
    bypassing = [
        f"{path.relative_to(script.HOUSE)}:{node.lineno}: {node.value!r}"
        for path in script.list_modules()
        for node in find_untranslated(
            ast.parse(path.read_text("utf-8")),
            errors_are_shown=not {"kiosk", "souvenirs"} & set(path.parts),
        )
    ]
    assert not bypassing, "use tr, tr_n, later or labelled of enliven_viewer.language:\n" + "\n".join(
        bypassing
    )


def test_a_text_without_a_translation_is_found() -> None:
    module = """
def draw(workspace, name, count):
    imgui.button("Save it")
    imgui.button("Save###save")
    imgui.text_unformatted(f"{count} bones of it")
    said = "Choose one" if name else tr("Choose two")
    draw.add_text(at, colour, said)
    editor.toasts.say(tr("fine"), "It is saved.")
    editor.edit(f"move {name}", change)
    raise InputError("no such thing", where="shape", remedy=tr("Fine."))
"""
    assert [node.value for node in find_untranslated(ast.parse(module))] == [
        *("Save it", "Save###save", " bones of it", "Choose one", "It is saved.", "move ", "no such thing"),
    ]
    fine = """
def draw(workspace, name, count):
    imgui.button(labelled(tr("Save it"), "Save it"))
    imgui.button(f"{tr(name)}###Save it")
    imgui.button("##Only an id")
    imgui.text(tr("{0} bones", count))
    editor.edit("move it", change)
"""
    assert list(find_untranslated(ast.parse(fine))) == []


def test_a_language_changes_at_once_and_is_kept(tmp_path) -> None:
    workspace = Workspace.new(Editor(), tmp_path)
    undo = workspace.actions["edit.undo"]
    assert tr(undo.label) == "Undo" and language_in_use() == "en"
    workspace.preferences.set_language("de")
    assert tr(undo.label) == "Rückgängig" and undo.label == "Undo"
    assert workspace.actions.make_tooltip(undo).startswith("Rückgängig  (Ctrl+Z)")
    workspace.actions.do("edit.undo")
    assert workspace.editor.toasts.shown[-1].text == "Es gibt nichts mehr rückgängig zu machen"
    set_language("en")
    assert Preferences(tmp_path).language == language_in_use() == "de"
    workspace.preferences.set_language("xx")
    assert language_in_use() == "en" and tr("Undo") == "Undo"


def test_an_action_is_found_by_its_name_in_both_languages(tmp_path) -> None:
    workspace = Workspace.new(Editor(), tmp_path)
    workspace.preferences.set_language("de")
    for typed in ("Rückgängig", "Undo", "rückg"):
        assert workspace.actions.find(typed)[0].id == "edit.undo", typed
    assert (
        workspace.actions.find("Verlauf")[0].id == workspace.actions.find("History")[0].id == "edit.history"
    )
    workspace.preferences.set_language("en")
    assert workspace.actions.find("Undo")[0].id == "edit.undo"


def test_values_plurals_and_tables_follow_the_language() -> None:
    names = Texts({"dark": "Dark"})
    assert (
        names["dark"] == "Dark"
        and tr("{0} is already the shortcut of \u201c{1}\u201d.", "A", "x")
        == "A is already the shortcut of “x”."
    )
    assert [tr_n("{0} bone of {1}", "{0} bones of {1}", count, "it") for count in (1, 2)] == [
        "1 bone of it",
        "2 bones of it",
    ]
    set_language("de")
    assert names["dark"] == "Dunkel" and list(names.values()) == ["Dunkel"]
    assert tr("") == "" and tr("a name that nobody translates") == "a name that nobody translates"


@pytest.mark.slow
def test_german_fits_into_the_window_and_keeps_every_widget(tmp_path) -> None:
    shown = in_a_window(SESSION, str(tmp_path))
    assert len(shown) == 11
    for name, report in shown.items():
        assert report["letters"] > 100, f"{name}: the letters were not found"
        assert not report["cut"], f"{name}: {report['cut']}"
        assert not report["overlapping"], f"{name}: {report['overlapping']}"
        assert report["widgets"] == report["widgets in English"], name
