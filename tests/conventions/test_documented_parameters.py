"""Tests that a docstring's ``Args:`` and ``Attributes:`` list only names that exist."""

import ast
import re
import textwrap
from collections.abc import Iterator

import pytest
from source_tree import ROOT, list_nodes

FOLDERS = ("shared", "edge", "viewer", "synthesis", "scripts", "examples", "tests")
SECTION = re.compile(r"^(Args|Attributes):\n((?:(?:    .*)?(?:\n|$))+)", re.MULTILINE)
"""A section of a docstring: its heading, and all lines that are indented more than the heading."""
ENTRY = re.compile(r"^    (?! )([^:\n]+): ", re.MULTILINE)
"""Matches the names at the start of an entry, such as ``near, far``. Continuation lines are indented further.
"""

Function = ast.FunctionDef | ast.AsyncFunctionDef


def unknown_names(tree: ast.AST) -> Iterator[str]:
    """Yields ``line: owner: name`` for each documented parameter or attribute that does not exist."""
    for node in list_nodes(tree):
        if not isinstance(node, Function | ast.ClassDef):
            continue
        for heading, entries in SECTION.findall(ast.get_docstring(node) or ""):
            existing = _names_of_class(node, heading) if isinstance(node, ast.ClassDef) else _parameters(node)
            for names in ENTRY.findall(entries):
                for name in (text.strip(" `*") for text in names.split(",")):
                    if name not in existing:
                        yield f"{node.lineno}: {node.name}: {name}"


def _parameters(function: Function) -> set[str]:
    """Returns the names of all parameters of a function, including ``*args`` and ``**options``."""
    args = function.args
    rest = [parameter for parameter in (args.vararg, args.kwarg) if parameter is not None]
    return {each.arg for each in (*args.posonlyargs, *args.args, *args.kwonlyargs, *rest)}


def _names_of_class(node: ast.ClassDef, heading: str) -> set[str]:
    """Returns the names that a class's docstring may list: parameters of its constructor, or attributes.

    The constructor of a dataclass or named tuple has the fields as parameters.
    """
    methods = [each for each in node.body if isinstance(each, Function)]
    constructors = [each for each in methods if each.name in ("__init__", "__new__")]
    if heading == "Args" and constructors:
        return set().union(*map(_parameters, constructors))
    names = set()
    for each in list_nodes(node):
        # Properties that only type checkers read are defined in a nested ``if TYPE_CHECKING``.
        if isinstance(each, Function):
            names.add(each.name)
        elif isinstance(each, ast.Name | ast.Attribute) and isinstance(each.ctx, ast.Store):
            names.add(each.id if isinstance(each, ast.Name) else each.attr)
    return names


@pytest.mark.parametrize("folder", FOLDERS)
def test_documented_parameters_exist(folder: str) -> None:
    """Checks that all listed names exist. If one was renamed or removed in the code, change the docstring as
    well.
    """
    texts = {path: path.read_text(encoding="utf-8") for path in sorted((ROOT / folder).rglob("*.py"))}
    unknown = [
        f"{path.relative_to(ROOT)}:{name}"
        for path, text in texts.items()
        if "Args:" in text or "Attributes:" in text
        for name in unknown_names(ast.parse(text))
    ]
    assert unknown == []


def test_unknown_documented_names_are_found() -> None:
    """Functions, constructors, fields and properties are compared. Continued lines are not names."""
    source = '''
        def scale(mesh, *factors, centre=None, **options):
            """Scales.

            Args:
                mesh: the surface:
                    with a colon: in a continued line.
                factors, middle: the second was renamed.
                **options: passed on.

            Returns:
                result: not a parameter.
            """
        class Shape:
            """A shape.

            Args:
                size: metres.
                width: it does not exist.

            Attributes:
                area: it is set by the constructor.
                name: a property.
                colour: it does not exist.
            """
            def __init__(self, size):
                self.area = size * size
            @property
            def name(self): ...
        @dataclass
        class Point:
            """A point.

            Args:
                x: metres.
                y: it does not exist.
            """
            x: float
    '''
    assert list(unknown_names(ast.parse(textwrap.dedent(source)))) == [
        "2: scale: middle",
        "14: Shape: width",
        "14: Shape: colour",
        "31: Point: y",
    ]
