"""Finds texts that the window draws or announces without a translation."""

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
"""Functions of ImGui with visible texts."""
LABELLED = {
    *("button", "small_button", "checkbox", "radio_button", "selectable", "menu_item", "text"),
    *("text_unformatted", "text_wrapped", "text_disabled"),
}
"""The functions of :data:`WIDGETS` whose first argument is visible text and not only an ID."""
TELLING = {
    "add_text",
    "say",
    "show_error",
    "show_message",
    "tell",
    "draw_caption",
    "shorten_text",
    "_draw_wrapped_text",
    "_draw_centred",
    "_show_notes",
}
"""Methods and functions that draw or announce all their text arguments."""
ERRORS = {"InputError", "ResourceError", "FileChangedError"}
"""Errors that the window shows. The location of the error is not translated."""
STEPS = {"edit", "drop"}
"""Methods with the name of a history step as argument, which is translated when the history is drawn."""
SAME_EVERYWHERE = {"Shift", "enliven", "Ctrl"}
"""Names that are the same in every language."""


FOR_DEVELOPERS = {
    *("no widget ", " is on the screen", "Known: ", "the shortcut ", " is already used by "),
    *("this action id exists already", "Choose another id or shortcut."),
    "Use --film out.mp4 to render without a window, or start on a computer with a display.",
}
"""Errors that appear in a terminal or for a plugin's author, not in the window."""


def find_untranslated(tree: ast.AST, *, errors_are_shown: bool = True) -> Iterator[ast.Constant]:
    """Yields the literals of a module that are shown without translation.

    Args:
        errors_are_shown: False if its errors go to the log or the terminal of an operator, in English.
    """
    for function in [tree, *(node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))]:
        values = collect_assignments(function)
        for call in iterate_own_nodes(function):
            if isinstance(call, ast.Call) and (errors_are_shown or not is_error(call)):
                for argument in shown_arguments(call):
                    yield from find_literals(argument, values, plain_word=is_label(call, argument))


def is_error(call: ast.Call) -> bool:
    """Returns True if a call creates one of :data:`ERRORS`."""
    return isinstance(call.func, ast.Name) and call.func.id in ERRORS


def iterate_own_nodes(function: ast.AST) -> Iterator[ast.AST]:
    """Yields the nodes of a function or module in order, without those of nested functions."""
    for node in ast.iter_child_nodes(function):
        if not isinstance(node, ast.FunctionDef):
            yield node
            yield from iterate_own_nodes(node)
        elif isinstance(function, ast.ClassDef):
            continue


def collect_assignments(function: ast.AST) -> dict[str, list[ast.expr]]:
    """Returns the values that a function assigns to each plain name."""
    values: dict[str, list[ast.expr]] = {}
    for node in iterate_own_nodes(function):
        if isinstance(node, ast.Assign):
            for target in node.targets:
                pairs = [(target, node.value)]
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    pairs = list(zip(target.elts, node.value.elts, strict=False))
                for name, value in pairs:
                    if isinstance(name, ast.Name):
                        values.setdefault(name.id, []).append(value)
    return values


def shown_arguments(call: ast.Call) -> list[ast.expr]:
    """Returns the visible arguments of a call; an empty list for a call that shows nothing."""
    function = call.func
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    of_imgui = isinstance(function, ast.Attribute) and getattr(function.value, "id", "") == "imgui"
    if of_imgui and name in WIDGETS:
        return call.args[:3]
    if name in TELLING:
        return call.args
    if name in ERRORS:
        return [*call.args, *(keyword.value for keyword in call.keywords if keyword.arg == "remedy")]
    if name in STEPS and call.args and isinstance(call.args[0], ast.JoinedStr):
        return call.args[:1]
    return []


def is_label(call: ast.Call, argument: ast.expr) -> bool:
    """Returns True if an argument is drawn unchanged, so that even one lower-case word is a text, not an
    ID."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else ""
    return name == "add_text" or (name in LABELLED and argument is call.args[0])


def find_literals(
    node: ast.expr, known: dict[str, list[ast.expr]], *, plain_word: bool = False
) -> Iterator[ast.Constant]:
    """Yields the readable literals that an expression can evaluate to, also through plain names.

    Args:
        plain_word: True if one lower-case word counts as text.
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
        yield from find_literals(node.body, known, plain_word=plain_word)
        yield from find_literals(node.orelse, known, plain_word=plain_word)
    elif isinstance(node, ast.BoolOp):
        for value in node.values:
            yield from find_literals(value, known)
    elif isinstance(node, ast.BinOp):
        yield from find_literals(node.left, known)
        yield from find_literals(node.right, known)
    elif isinstance(node, ast.Tuple | ast.List):
        for value in node.elts:
            yield from find_literals(value, known)
    elif isinstance(node, ast.Name):
        for value in known.get(node.id, []):
            if not isinstance(value, ast.Name):
                yield from find_literals(value, {}, plain_word=plain_word)


def is_readable(value: object, *, plain_word: bool = False) -> bool:
    """Returns True if a literal has two letters, and a space or a capital, unlike an ID or a number.

    Args:
        plain_word: True if two letters are enough.
    """
    if not isinstance(value, str) or value.startswith("##") or value in SAME_EVERYWHERE | FOR_DEVELOPERS:
        return False
    letters = re.search(r"[^\W\d_]{2}", value.partition("##")[0])
    return bool(letters) and (plain_word or bool(re.search(r" |[A-Z]", value.strip())))
