"""Finds texts of the window that are drawn or told without a translation."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

WIDGETS = {
    *("button", "small_button", "checkbox", "radio_button", "selectable", "menu_item", "menu_item_simple"),
    *("begin_menu", "begin_combo", "begin", "collapsing_header", "tree_node", "combo", "slider_float"),
    *("slider_int", "input_text_with_hint", "text", "text_unformatted", "text_wrapped", "text_disabled"),
    *("text_colored", "set_tooltip", "calc_text_size", "separator_text", "begin_tab_item"),
}
"""Functions of ImGui with texts that people see."""
LABELLED = {
    *("button", "small_button", "checkbox", "radio_button", "selectable", "menu_item", "text"),
    *("text_unformatted", "text_wrapped", "text_disabled"),
}
"""Those of them with a first argument that is seen, and no id alone."""
TELLING = {"add_text", "say", "complain", "tell", "caption", "fitting", "_wrapped", "_centred", "_tell"}
"""Methods and functions that draw or tell all their texts."""
ERRORS = {"InputError", "ResourceError", "FileChangedError"}
"""Errors that the window shows; the place where they happened is not translated."""
STEPS = {"edit", "drop"}
"""Methods with the name of a step of the history, which is translated where the history is drawn."""
SAME_EVERYWHERE = {"Shift", "enliven", "Ctrl"}
"""Names that are the same in every language."""


FOR_DEVELOPERS = {
    *("there is no widget ", " on the screen", "Known: ", " is ", "it is there already"),
    *("Give it another id or key.",),
    "Use --film out.mp4 to render without a window, or start where there is a display.",
}
"""Errors that reach a terminal or the author of a plugin, not the window."""


def untranslated(tree: ast.AST) -> Iterator[ast.Constant]:
    """Yields the literals of a module that reach people as they stand in the code."""
    for function in [tree, *(one for one in ast.walk(tree) if isinstance(one, ast.FunctionDef))]:
        known = assigned(function)
        for call in own(function):
            if isinstance(call, ast.Call):
                for argument in shown_arguments(call):
                    yield from literals(argument, known, plain_word=is_label(call, argument))


def own(function: ast.AST) -> Iterator[ast.AST]:
    """Yields the nodes of a function or module in their order, without those of the functions in it."""
    for node in ast.iter_child_nodes(function):
        if not isinstance(node, ast.FunctionDef):
            yield node
            yield from own(node)
        elif isinstance(function, ast.ClassDef):
            continue


def assigned(function: ast.AST) -> dict[str, list[ast.expr]]:
    """Returns what a function assigns to each plain name."""
    found: dict[str, list[ast.expr]] = {}
    for node in own(function):
        if isinstance(node, ast.Assign):
            for target in node.targets:
                pairs = [(target, node.value)]
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    pairs = list(zip(target.elts, node.value.elts, strict=False))
                for name, value in pairs:
                    if isinstance(name, ast.Name):
                        found.setdefault(name.id, []).append(value)
    return found


def shown_arguments(call: ast.Call) -> list[ast.expr]:
    """Returns the arguments of a call that people see; none for a call that shows nothing."""
    function = call.func
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    of_imgui = isinstance(function, ast.Attribute) and getattr(function.value, "id", "") == "imgui"
    if of_imgui and name in WIDGETS:
        return call.args[:3]
    if name in TELLING:
        return call.args
    if name in ERRORS:
        return [*call.args, *(one.value for one in call.keywords if one.arg == "mend")]
    if name in STEPS and call.args and isinstance(call.args[0], ast.JoinedStr):
        return call.args[:1]
    return []


def is_label(call: ast.Call, argument: ast.expr) -> bool:
    """Whether an argument is drawn unchanged, so that even one word in small letters is a text, not an id."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else ""
    return name == "add_text" or (name in LABELLED and argument is call.args[0])


def literals(
    node: ast.expr, known: dict[str, list[ast.expr]], *, plain_word: bool = False
) -> Iterator[ast.Constant]:
    """Yields the readable literals that an expression can be, by way of plain names too.

    Args:
        plain_word: whether one word in small letters is a text.
    """
    if isinstance(node, ast.Constant):
        if is_readable(node.value, plain_word=plain_word):
            yield node
    elif isinstance(node, ast.JoinedStr):
        for part in node.values:
            if isinstance(part, ast.Constant):
                text = part.value.partition("##")[0]
                if re.search(r"[A-Za-z]{2}", text) and text not in FOR_DEVELOPERS:
                    yield part
                if "##" in part.value:
                    break
    elif isinstance(node, ast.IfExp):
        yield from literals(node.body, known, plain_word=plain_word)
        yield from literals(node.orelse, known, plain_word=plain_word)
    elif isinstance(node, ast.BoolOp):
        for value in node.values:
            yield from literals(value, known)
    elif isinstance(node, ast.BinOp):
        yield from literals(node.left, known)
        yield from literals(node.right, known)
    elif isinstance(node, ast.Tuple | ast.List):
        for value in node.elts:
            yield from literals(value, known)
    elif isinstance(node, ast.Name):
        for value in known.get(node.id, []):
            if not isinstance(value, ast.Name):
                yield from literals(value, {}, plain_word=plain_word)


def is_readable(value: object, *, plain_word: bool = False) -> bool:
    """Whether a literal has two letters, and a space or a capital: an id and a number have not.

    Args:
        plain_word: whether two letters are enough.
    """
    if not isinstance(value, str) or value.startswith("##") or value in SAME_EVERYWHERE | FOR_DEVELOPERS:
        return False
    letters = re.search(r"[^\W\d_]{2}", value.partition("##")[0])
    return bool(letters) and (plain_word or bool(re.search(r" |[A-Z]", value.strip())))
