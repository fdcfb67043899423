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

HOUSE = Path(__file__).parents[1]
PAGE = HOUSE / "docs" / "architecture.md"
sys.path[:0] = [str(HOUSE / "tests" / "house"), str(HOUSE / "scripts")]

from house import House, Rules, project_house  # noqa: E402
from walks import Walk  # noqa: E402
from walks import table as walked  # noqa: E402

NAMES = {
    "enliven": "The library",
    "enliven_edge": "The edge",
    "enliven_viewer": "The viewer",
    "enliven_synthesis": "Synthesis",
}
INDENT = "&nbsp;" * 4
"""Indentation of a package's name relative to its parent's."""


def purpose(house: House, room: str) -> str:
    """Returns the first sentence of a package's docstring, on one line."""
    text = ast.get_docstring(ast.parse(house.modules[room].read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())


def table(house: House, package: str) -> str:
    """Returns a table of a package's subpackages in import order, with the purpose and the number of modules
    of each."""
    counts = Counter(house.room_of(module) for module in house.modules.keys() - house.doors)
    rooms = sorted(
        (room for room in house.doors if room.startswith(f"{package}.")),
        key=lambda room: place(house.rules, room),
    )
    rows = [
        f"| {INDENT * (room.count('.') - 1)}`{room.rpartition('.')[2]}` "
        f"| {purpose(house, room)} | {counts[room] or ''} |"
        for room in rooms
    ]
    return "\n".join(["| room | what it is for | modules |", "|---|---|---|", *rows])


def place(rules: Rules, room: str) -> tuple[tuple[int, str], ...]:
    """Returns the sort key of a package: for each folder on its path the configured position, or its name if
    it has no position."""
    parts = room.split(".")
    sort_key = []
    for depth in range(1, len(parts)):
        order = rules.order.get(".".join(parts[:depth]), [])
        sort_key.append((order.index(parts[depth]) if parts[depth] in order else 0, parts[depth]))
    return tuple(sort_key)


def drawing(house: House, package: str) -> str:
    """Returns the subpackages as a Mermaid diagram. Arrows are imports; imports implied by others are left
    out (transitive reduction)."""
    inside = {room.split(".")[1] for room in house.doors if room.startswith(f"{package}.")}
    after: dict[str, set[str]] = {room: set() for room in inside}
    for dependency in house.imports:
        source, target = dependency.source.split(".")[:2], dependency.target.split(".")[:2]
        if source[0] == target[0] == package and source != target and {source[-1], target[-1]} <= inside:
            after[source[-1]].add(target[-1])

    def reach(room: str) -> set[str]:
        return after[room].union(*(reach(other) for other in after[room]))

    arrows = [
        f"    {room} --> {other}"
        for room in sorted(after)
        for other in sorted(after[room])
        if not any(other in reach(third) for third in after[room])
    ]
    return "\n".join(["```mermaid", "graph TD", *arrows, "```"])


def written(page: str) -> str:
    """Returns the page with everything between its marks regenerated."""
    house = project_house()
    walks = Walk.read()
    makers = {
        "rooms": table,
        "arrows": drawing,
        "walk": lambda house, name: walked(house, walks[name]),
    }

    def made(match: re.Match[str]) -> str:
        kind, package = match[1], match[2]
        return f"<!-- {kind} {package} -->\n\n{makers[kind](house, package)}\n\n<!-- end -->"

    return re.sub(r"<!-- (rooms|arrows|walk) (\w+) -->.*?<!-- end -->", made, page, flags=re.DOTALL)


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
