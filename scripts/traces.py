"""The traces of docs/architecture.md: the way of a value through the code, from function to function."""

from __future__ import annotations

import ast
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

from source_tree import SourceTree

TRACES = Path(__file__).with_name("traces.toml")


@dataclass(frozen=True)
class Trace:
    """One trace.

    Attributes:
        title: the start and the end of the trace.
        most: maximum number of files.
        steps: the functions, see ``traces.toml``.
    """

    title: str
    most: int
    steps: list[dict[str, str]]

    @staticmethod
    def read(path: Path = TRACES) -> dict[str, Trace]:
        """Reads the traces of a file, by name."""
        return {
            name: Trace(**entry) for name, entry in tomllib.loads(path.read_text(encoding="utf-8")).items()
        }


def table(tree: SourceTree, trace: Trace) -> str:
    """Returns a table of a trace's files in order.

    It contains the function that receives the value, and the first sentence of its docstring.

    Raises:
        ValueError: if a function does not exist, is not mentioned by an earlier function of the trace, or has
            no docstring.
    """
    rows, before = list[str](), list[str]()
    for step in trace.steps:
        path, name, description = _place(tree, step["at"])
        word = step.get("by", name.split(".")[-1])
        if word and not any(re.search(rf"\b{re.escape(word)}\b", text) for text in before):
            raise ValueError(f"{step['at']}: no earlier file of the trace contains {word!r}")
        description = step.get("says", description)
        if not description:
            raise ValueError(f"{step['at']} has no docstring, and this step of the trace has no key `says`")
        before.append(path.read_text(encoding="utf-8"))
        place = path.relative_to(tree.root).as_posix()
        rows.append(f"| {len(rows) + 1} | [{place}](../{place}) | `{name or path.name}` | {description} |")
    if len(rows) > trace.most:
        raise ValueError(f"{trace.title}: {len(rows)} files, but at most {trace.most} are allowed")
    head = [f"### {trace.title}: {len(rows)} files", "", "| | file | function | what it does |"]
    return "\n".join([*head, "|---|---|---|---|", *rows])


def _place(tree: SourceTree, at: str) -> tuple[Path, str, str]:
    """Returns the file of a function, its name, and the first sentence of its docstring."""
    if "/" in at:
        path = tree.root / at
        if not path.is_file():
            raise ValueError(f"the file {at} does not exist")
        return path, "", ""
    module, _, name = at.partition(":")
    if module not in tree.modules:
        raise ValueError(f"the module {module} does not exist")
    path = tree.modules[module]
    body: list[ast.stmt] = ast.parse(path.read_text(encoding="utf-8")).body
    definition: ast.stmt | None = None
    for part in name.split("."):
        kinds = ast.ClassDef | ast.FunctionDef
        definition = next((node for node in body if isinstance(node, kinds) and node.name == part), None)
        if definition is None:
            raise ValueError(f"the module {module} has no function or class {name}")
        body = definition.body  # type: ignore[attr-defined]
    text = ast.get_docstring(definition) or ""  # type: ignore[arg-type]
    return path, name, re.split(r"(?<=\.)\s|\n\n|:\n", " ".join(text.split("\n\n")[0].split()))[0]
