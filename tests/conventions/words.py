"""Reads the names, constants and docstrings of the packages and reports those that a new reader could not
understand.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from source_tree import list_nodes

RIDDLES = re.compile(r"\b(somebody|nobody|whoever|whomever|whose)\b", re.IGNORECASE)
"""Pronouns for a person in place of a noun. The reader has to find out which object they mean."""
_CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*")


@cache
def body_of(path: Path) -> list[ast.stmt]:
    """Returns the statements of a module, parsed once for all rules."""
    return ast.parse(path.read_text(encoding="utf-8")).body


def riddles(path: Path) -> Iterator[str]:
    """Yields a sentence for each docstring with a pronoun in place of a noun."""
    text = path.read_text(encoding="utf-8")
    for node in list_nodes(ast.parse(text)) if RIDDLES.search(text) else ():
        full_text = _text_of(node)
        for riddle in RIDDLES.finditer(full_text):
            line = node.lineno + full_text[: riddle.start()].count("\n")
            yield f"{path}:{line}: says {riddle[0]!r}: name what is meant."


def mute_constants(path: Path) -> Iterator[str]:
    """Yields a sentence for each numeric constant of a module that has no docstring."""
    body = body_of(path)
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign | ast.AnnAssign):
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        names = [name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)]
        names = [name for name in names if _CONSTANT.fullmatch(name)]
        if not names or not _is_number(node.value):
            continue
        text = _text_of(after)
        if len(names) > 1:
            yield f"{path}:{node.lineno}: {', '.join(names)} share a line: each needs its unit and reason."
        elif not text:
            yield f"{path}:{node.lineno}: {names[0]} has no sentence: say its unit and its reason below it."


def _text_of(node: ast.AST | None) -> str:
    """Returns the words of a docstring, or of the docstring below a constant. Empty for other nodes."""
    words = node.value if isinstance(node, ast.Expr) else None
    return words.value if isinstance(words, ast.Constant) and isinstance(words.value, str) else ""


def _is_number(value: ast.expr | None) -> bool:
    """Returns True if a constant's value is made of literals alone."""
    if value is None:
        return False
    names = [node for node in ast.walk(value) if isinstance(node, ast.Name | ast.Attribute | ast.Call)]
    constants = [node.value for node in ast.walk(value) if isinstance(node, ast.Constant)]
    return not names and any(isinstance(constant, int | float) for constant in constants)


def shared_names(paths: list[Path]) -> Iterator[str]:
    """Yields a sentence for each public class name that several modules define."""
    where: dict[str, list[Path]] = defaultdict(list)
    for path in paths:
        for node in body_of(path):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                where[node.name].append(path)
    for name, places in sorted(where.items()):
        if len(places) > 1:
            yield f"{name} is a class in {', '.join(map(str, places))}: one name, one meaning."


def undescribed(paths: list[Path]) -> Iterator[str]:
    """Yields a sentence for each public class, function or method without a docstring.

    A method may inherit its docstring from a base class or from a protocol that its class implements. A
    setter may inherit it from its property.
    """
    bodies = {path: body_of(path) for path in paths}
    kinds = {item.name: item for body in bodies.values() for item in body if isinstance(item, ast.ClassDef)}
    protocols = [
        item for item in kinds.values() if any(ast.unparse(base) == "Protocol" for base in item.bases)
    ]
    for path, body in bodies.items():
        for item in body:
            if not isinstance(item, ast.ClassDef | ast.FunctionDef) or item.name.startswith("_"):
                continue
            if not ast.get_docstring(item):
                yield f"{path}:{item.lineno}: {item.name} has no docstring: say what it is, in one sentence."
            for method in _methods(item) if isinstance(item, ast.ClassDef) else ():
                sources = [item, *(protocol for protocol in protocols if _fulfils(item, protocol))]
                is_described = any(_described(source, method.name, kinds) for source in sources)
                if not method.name.startswith("_") and not is_described:
                    name = f"{item.name}.{method.name}"
                    yield f"{path}:{method.lineno}: {name} has no docstring: say what it does."


def _methods(kind: ast.ClassDef) -> Iterator[ast.FunctionDef]:
    return (node for node in kind.body if isinstance(node, ast.FunctionDef))


def _fulfils(kind: ast.ClassDef, protocol: ast.ClassDef) -> bool:
    """Returns True if a class has every method of a protocol."""
    return {method.name for method in _methods(protocol)} <= {method.name for method in _methods(kind)}


def _described(kind: ast.ClassDef, name: str, kinds: dict[str, ast.ClassDef]) -> bool:
    """Returns True if the class or one of its base classes in the product documents the method."""
    if any(ast.get_docstring(method) for method in _methods(kind) if method.name == name):
        return True
    bases = [ast.unparse(base).partition("[")[0].rpartition(".")[2] for base in kind.bases]
    return any(_described(kinds[base], name, kinds) for base in bases if kinds.get(base) not in (None, kind))
