"""The traces of docs/architecture.md: a value followed through the code, from function to function."""

from __future__ import annotations

import ast
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

from house import House

WALKS = Path(__file__).with_name("walks.toml")


@dataclass(frozen=True)
class Walk:
    """One trace.

    Attributes:
        title: its start and end.
        most: maximum number of files.
        steps: the functions, see ``walks.toml``.
    """

    title: str
    most: int
    steps: list[dict[str, str]]

    @staticmethod
    def read(path: Path = WALKS) -> dict[str, Walk]:
        """Reads the traces of a file, by name."""
        return {
            name: Walk(**entry) for name, entry in tomllib.loads(path.read_text(encoding="utf-8")).items()
        }


def table(house: House, walk: Walk) -> str:
    """Returns a table of a trace's files in order, with the function that receives the value and the first
    sentence of its docstring.

    Raises:
        ValueError: if a function does not exist, is not mentioned by an earlier function of the trace, or has
            no docstring.
    """
    rows, before = list[str](), list[str]()
    for step in walk.steps:
        path, name, description = _place(house, step["at"])
        word = step.get("by", name.split(".")[-1])
        if word and not any(re.search(rf"\b{re.escape(word)}\b", text) for text in before):
            raise ValueError(f"{step['at']}: no file before it in the walk says {word!r}")
        description = step.get("says", description)
        if not description:
            raise ValueError(f"{step['at']} has no docstring, and the walk says nothing of it")
        before.append(path.read_text(encoding="utf-8"))
        place = path.relative_to(house.root).as_posix()
        rows.append(f"| {len(rows) + 1} | [{place}](../{place}) | `{name or path.name}` | {description} |")
    if len(rows) > walk.most:
        raise ValueError(f"{walk.title}: {len(rows)} files, {len(rows) - walk.most} too many")
    head = [f"### {walk.title}: {len(rows)} files", "", "| | file | function | what it does |"]
    return "\n".join([*head, "|---|---|---|---|", *rows])


def _place(house: House, at: str) -> tuple[Path, str, str]:
    """Returns the file of a function, its name, and the first sentence of its docstring."""
    if "/" in at:
        path = house.root / at
        if not path.is_file():
            raise ValueError(f"{at} is not there")
        return path, "", ""
    module, _, name = at.partition(":")
    if module not in house.modules:
        raise ValueError(f"there is no module {module}")
    path = house.modules[module]
    body: list[ast.stmt] = ast.parse(path.read_text(encoding="utf-8")).body
    definition: ast.stmt | None = None
    for part in name.split("."):
        kinds = ast.ClassDef | ast.FunctionDef
        definition = next((node for node in body if isinstance(node, kinds) and node.name == part), None)
        if definition is None:
            raise ValueError(f"{module} has no {name}")
        body = definition.body  # type: ignore[attr-defined]
    text = ast.get_docstring(definition) or ""  # type: ignore[arg-type]
    return path, name, re.split(r"(?<=\.)\s|\n\n|:\n", " ".join(text.split("\n\n")[0].split()))[0]
