"""Tests that docs/library.md has a row and an example for every name of ``from enliven import``."""

import ast
import inspect
import re
import subprocess
import sys

from blocks import ROOT, blocks_of

import enliven

PAGE = ROOT / "docs" / "library.md"
ROWS = "\n".join(
    line.split("|")[1] for line in PAGE.read_text(encoding="utf-8").splitlines() if line[:1] == "|"
)


def test_every_name_has_a_row():
    assert set(re.findall(r"`(\w+)`", ROWS)) == set(enliven.__all__)


def test_every_name_is_imported_and_used_by_an_example():
    used: set[str] = set()
    imported: set[str] = set()
    for block in blocks_of(PAGE):
        assert block.kind == "python" and not block.reason, block
        for node in ast.walk(ast.parse(block.text)):
            if isinstance(node, ast.ImportFrom) and node.module == "enliven":
                imported |= {alias.name for alias in node.names}
            elif isinstance(node, ast.Name):
                used.add(node.id)
    assert imported == set(enliven.__all__) and imported <= used


def test_every_public_name_has_a_docstring():
    for name in enliven.__all__:
        docstring = inspect.getdoc(getattr(enliven, name)) or ""
        assert re.match(r"[A-Z`].*[.:]", docstring), f"{name}: {docstring[:60]!r}"
        assert not docstring.startswith(f"{name}("), f"{name} has no docstring of its own"


def test_an_import_loads_nothing_else():
    code = "import sys, enliven; print(sorted({name.partition('.')[0] for name in sys.modules}))"
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert "'lazy_loader'" in output
    assert [
        name for name in ("numpy", "scipy", "numba", "trimesh", "zmq", "typer") if f"'{name}'" in output
    ] == []
