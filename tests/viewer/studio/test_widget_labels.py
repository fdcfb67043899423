"""Tests that every widget keeps its id while it is shown.

ImGui derives the id from the label, so a label that changes during a press loses the click. The variable part
must be before ``###``, which excludes it from the id.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

VIEWER = Path(__file__).parents[3] / "viewer" / "enliven_viewer"
WIDGETS = {
    *("button", "small_button", "invisible_button", "arrow_button", "image_button", "text_link"),
    *("selectable", "checkbox", "radio_button", "menu_item", "menu_item_simple", "begin_menu"),
    *("tree_node", "tree_node_ex", "collapsing_header", "begin_combo", "combo", "list_box"),
    *("begin_tab_item", "tab_item_button", "begin", "begin_child", "begin_popup", "begin_popup_modal"),
    *("open_popup", "color_edit3", "color_edit4"),
}
"""Functions of ImGui that derive an id from their first argument."""
PREFIXES = ("slider_", "drag_", "input_", "v_slider_")
HELPERS = {"draw_button": 1, "draw_choice": 1, "draw_switch": 1, "open_modal": 0, "panel": 0}
"""Functions of the project that pass on a label, with the label's argument index. Their callers are checked
instead.
"""
PASSED_ON = {
    *(("modal.py", word) for word in ("label", "title", "yes", "no")),
    *(("fields.py", "label"), ("style.py", "name"), ("layer_options.py", "label")),
    *(("dialogs.py", "title"), ("dialogs.py", "'Save' if browser.saving else 'Open'")),
}
"""Labels that helpers pass on, names of a layer's fields, and those of a file dialog. They are constant while
it is open.
"""
FIXED = {"action.label", "action.entry", "menu", "group"}
"""Labels of the table of actions, which do not change while the window is open."""
NAMES = {"name", "stem", "label", "id"}
"""Attributes that identify the items of a list. They are part of the item's id anyway."""


def is_constant(label: ast.expr) -> bool:
    """Returns True if an expression is a text, or a constant of its module."""
    if isinstance(label, ast.Name):
        return label.id.lstrip("_").isupper()
    if isinstance(label, ast.BinOp):
        return is_constant(label.left) and is_constant(label.right)
    return isinstance(label, ast.Constant)


def is_name(label: ast.expr, items: set[str]) -> bool:
    """Returns True if an expression is the name of the current item of an iterated list."""
    if isinstance(label, ast.Attribute):
        return label.attr in NAMES and is_name(label.value, items)
    return isinstance(label, ast.Name) and label.id in items


def keeps_its_id(label: ast.expr, items: set[str]) -> bool:
    """Returns True if the text before the id mark is constant, or is ignored."""
    if is_constant(label) or is_name(label, items) or ast.unparse(label) in FIXED:
        return True
    if isinstance(label, ast.Call) and ast.unparse(label.func) == "labelled":
        return True  # its second argument is the id
    if (
        isinstance(label, ast.IfExp)
        and isinstance(label.body, ast.Call)
        and isinstance(label.orelse, ast.Call)
    ):
        return ast.unparse(label.body.args[1]) == ast.unparse(label.orelse.args[1])
    if isinstance(label, ast.IfExp):
        ends = [ast.unparse(branch).partition("###") for branch in (label.body, label.orelse)]
        return all(mark for _, mark, _ in ends) and ends[0][2].strip("'\"") == ends[1][2].strip("'\"")
    if isinstance(label, ast.BinOp):
        return isinstance(label.right, ast.Constant) and str(label.right.value).startswith("###")
    if not isinstance(label, ast.JoinedStr):
        return False
    before, named = True, False
    for piece in label.values:
        if isinstance(piece, ast.Constant):
            if "###" in piece.value:
                return True
            named = named or "##" in piece.value
        elif piece.format_spec is not None:
            before = False  # a number is a part of the id, unless the mark comes after it
        elif not (is_constant(piece.value) or is_name(piece.value, items)):
            before = before and named
    return before


def labels(tree: ast.AST) -> Iterator[tuple[int, ast.expr]]:
    """Returns the labels of all widgets of a module, with their lines."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        called, place = node.func, None
        if isinstance(called, ast.Attribute) and ast.unparse(called.value) == "imgui":
            place = 0 if called.attr in WIDGETS or called.attr.startswith(PREFIXES) else None
        elif isinstance(called, ast.Name):
            place = HELPERS.get(called.id)
        if place is not None and len(node.args) > place:
            yield node.lineno, node.args[place]


def changing(name: str, text: str) -> list[str]:
    """Returns the labels of a module that may change while they are shown."""
    places, tree = [], ast.parse(text)
    loops = [node.target for node in ast.walk(tree) if isinstance(node, ast.For)]
    items = {node.id for target in loops for node in ast.walk(target) if isinstance(node, ast.Name)}
    for line, label in labels(tree):
        if not keeps_its_id(label, items) and (name, ast.unparse(label)) not in PASSED_ON:
            places.append(f"{name}:{line}: {ast.unparse(label)}")
    return places


@pytest.mark.slow
def test_no_label_changes_the_id_of_its_widget() -> None:
    offenders = [
        label for path in sorted(VIEWER.rglob("*.py")) for label in changing(path.name, path.read_text())
    ]
    assert not offenders, (
        'write f"{what changes}###a name that stays": the id would change while it is pressed\n'
        + "\n".join(offenders)
    )


@pytest.mark.parametrize(
    "label",
    [
        'f"Stop {clock(x)}"',
        "text",
        'f"Keep {it.name}"',
        'f"{x:.1f} s##stop"',
        '("a" if on else "b") + "##p"',
        'f"##{x:.1f}"',
    ],
)
def test_labels_that_change_are_found(label: str) -> None:
    assert changing("a.py", f"imgui.button({label})")
    assert changing("a.py", f"draw_button(workspace, {label})")


@pytest.mark.parametrize(
    "label",
    ['"Stop"', '_ICON + "##stop"', 'f"Stop {clock(x)}###stop"', 'f"Leave##{n}"', 'f"{x:.1f} s###{name}"'],
)
def test_labels_that_stay_pass(label: str) -> None:
    assert not changing("a.py", f"imgui.button({label})")
