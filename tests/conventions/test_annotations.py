"""Tests that every function of the product has type annotations, except compiled kernels, whose types Numba
infers.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("shared/enliven", "edge/enliven_edge", "viewer/enliven_viewer", "synthesis/enliven_synthesis")
COMPILED = ("njit", "intrinsic", "overload")
"""First words of decorators whose functions Numba compiles."""


def unannotated(tree: ast.AST, inside_class: bool = False) -> Iterator[str]:
    """Yields ``line: name`` of each function outside a kernel that lacks an annotation."""
    for node in ast.iter_child_nodes(tree):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from unannotated(node, inside_class or isinstance(node, ast.ClassDef))
            continue
        if any(ast.unparse(decorator).startswith(COMPILED) for decorator in node.decorator_list):
            continue
        parameters = [*node.args.posonlyargs, *node.args.args][int(inside_class and not is_static(node)) :]
        parameters += node.args.kwonlyargs
        if node.returns is None or any(parameter.annotation is None for parameter in parameters):
            yield f"{node.lineno}: {node.name}"
        yield from unannotated(node)


def is_static(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Returns True if a method is static, so it has neither ``self`` nor ``cls``."""
    return any(ast.unparse(decorator) == "staticmethod" for decorator in node.decorator_list)


def test_functions_outside_kernels_are_annotated() -> None:
    """Checks that each parameter and result has a type. Add annotations to the functions that a failure
    lists.
    """
    missing = [
        f"{path.relative_to(ROOT)}:{function}"
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
        for function in unannotated(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert missing == []


def test_missing_annotations_are_found() -> None:
    """Parameters, results, methods and nested functions without annotations are found. Kernels and ``self``
    are not.
    """
    source = """
class Shape:
    def area(self) -> float: ...
    def scale(self, factor): ...
    @staticmethod
    def unit(size) -> None: ...
@njit(cache=True)
def kernel(values):
    def inner(value): ...
def outer(value: int) -> None:
    def inner(value: int): ...
"""
    assert list(unannotated(ast.parse(source))) == ["4: scale", "6: unit", "11: inner"]
