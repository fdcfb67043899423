"""Updates the package tables of docs/architecture.md from the code: .venv/bin/python scripts/architecture.py

The text between a pair of marks is generated from docstrings and imports. A test checks that the page is up
to date.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "architecture.md"
sys.path[:0] = [str(ROOT / "tests" / "conventions"), str(ROOT / "scripts")]

import grimp  # noqa: E402
from source_tree import PACKAGES, SourceTree, import_levels, project_tree  # noqa: E402
from traces import Trace  # noqa: E402
from traces import table as trace_table  # noqa: E402

NAMES = {
    "enliven": "The library",
    "enliven_edge": "The edge",
    "enliven_viewer": "The viewer",
    "enliven_synthesis": "Synthesis",
}
INDENT = "&nbsp;" * 4
"""Indentation in a table of a package's name, relative to the name of its parent."""


def read_purpose(tree: SourceTree, package: str) -> str:
    """Returns the first sentence of a package's docstring, on one line."""
    text = ast.get_docstring(ast.parse(tree.modules[package].read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())


def make_table(tree: SourceTree, package: str) -> str:
    """Returns a table of a package's subpackages, the lowest level first.

    It has the purpose and the number of modules of each.
    """
    counts = Counter(tree.package_of(module) for module in tree.modules.keys() - tree.packages)
    levels = import_levels()
    inner = sorted(
        (name for name in tree.packages if name.startswith(f"{package}.")),
        key=lambda name: find_position(levels, name),
    )
    rows = [
        f"| {INDENT * (name.count('.') - 1)}`{name.rpartition('.')[2]}` "
        f"| {read_purpose(tree, name)} | {counts[name] or ''} |"
        for name in inner
    ]
    return "\n".join(["| package | what it is for | modules |", "|---|---|---|", *rows])


def find_position(levels: dict[str, list[list[str]]], package: str) -> tuple[tuple[int, str], ...]:
    """Returns the sort key of a package.

    It consists of the level and the name of each folder on the package's path.
    """
    parts = package.split(".")
    sort_key = []
    for depth in range(1, len(parts)):
        folder = levels.get(".".join(parts[:depth]), [])
        level = next((k for k, names in enumerate(folder) if parts[depth] in names), 0)
        sort_key.append((level, parts[depth]))
    return tuple(sort_key)


def make_drawing(graph: grimp.ImportGraph, tree: SourceTree, package: str) -> str:
    """Returns the subpackages as a Mermaid diagram.

    Arrows are imports. Imports that are implied by others are left out (transitive reduction).
    """
    inside = {name for name in graph.find_children(package) if name in tree.packages}
    owner = {module: name for name in inside for module in (name, *graph.find_descendants(name))}
    after: dict[str, set[str]] = {name: set() for name in inside}
    for module, name in owner.items():
        imported = (owner.get(other, name) for other in graph.find_modules_directly_imported_by(module))
        after[name] |= set(imported) - {name}

    def reach(name: str) -> set[str]:
        return after[name].union(*(reach(other) for other in after[name]))

    arrows = [
        f"    {name.rpartition('.')[2]} --> {other.rpartition('.')[2]}"
        for name in sorted(after)
        for other in sorted(after[name])
        if not any(other in reach(third) for third in after[name])
    ]
    return "\n".join(["```mermaid", "graph TD", *arrows, "```"])


def make_page(page: str) -> str:
    """Returns the page with everything between its marks regenerated."""
    tree, traces = project_tree(), Trace.read()
    graph = grimp.build_graph(*PACKAGES, cache_dir=None)

    def made(match: re.Match[str]) -> str:
        kind, name = match[1], match[2]
        if kind == "packages":
            text = make_table(tree, name)
        elif kind == "arrows":
            text = make_drawing(graph, tree, name)
        else:
            text = trace_table(tree, traces[name])
        return f"<!-- {kind} {name} -->\n\n{text}\n\n<!-- end -->"

    return re.sub(r"<!-- (packages|arrows|trace) (\w+) -->.*?<!-- end -->", made, page, flags=re.DOTALL)


if __name__ == "__main__":
    PAGE.write_text(make_page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
