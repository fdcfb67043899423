"""Reads the imports of the packages and tells which of them break the rules of ``rules.toml``.

A room is a folder of modules. Its door is the ``__init__``. The stub of the door names what other rooms may
use and the module that has it; a name is loaded when it is first asked for. In each folder modules and rooms
import one another in one direction.
"""

from __future__ import annotations

import ast
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path


@dataclass(frozen=True)
class Import:
    """One name that a module imports.

    Attributes:
        source: the module that imports, by its dotted name.
        target: the module or door that is imported from.
        name: what is imported; empty where the whole module is.
        line: the line of the import in the file of the source.
    """

    source: str
    target: str
    name: str
    line: int


@dataclass(frozen=True)
class Rules:
    """The rules of a house, see ``rules.toml``."""

    most_modules: int
    packages: dict[str, str]
    may_import: dict[str, list[str]]
    open: list[str] = field(default_factory=list)
    order: dict[str, list[str]] = field(default_factory=dict)
    exceptions: list[str] = field(default_factory=list)
    only_imported_by: dict[str, str] = field(default_factory=dict)

    @staticmethod
    def read(path: Path) -> Rules:
        """The rules in a TOML file."""
        return Rules(**tomllib.loads(path.read_text(encoding="utf-8")))


class House:
    """The modules and imports of all packages under a folder.

    Attributes:
        modules: files by dotted name; the file of a door by the name of its room.
        doors: the names of the rooms.
        imports: every import of one module by another, also in functions and for type checkers.
    """

    def __init__(self, root: Path, rules: Rules) -> None:
        self.root, self.rules = root, rules
        self.modules: dict[str, Path] = {}
        self.doors: set[str] = set()
        for package, folder in rules.packages.items():
            for path in sorted((root / folder).rglob("*.py")):
                parts = [package, *path.relative_to(root / folder).with_suffix("").parts]
                if parts[-1] == "__init__":
                    parts.pop()
                    self.doors.add(".".join(parts))
                self.modules[".".join(parts)] = path
        self.imports = [
            link for module, path in self.modules.items() for link in self._imports_of(module, path)
        ]

    def broken(self) -> list[str]:
        """A sentence for each import or folder that breaks a rule, and what to do about it."""
        complaints = [
            *self._foreign(),
            *self._round_doors(),
            *self._back(),
            *self._circles(),
            *self._two_meanings(),
            *self._crowded(),
            *self._mute(),
            *self._past_their_gate(),
        ]
        return [complaint for complaint in complaints if complaint not in self.rules.exceptions]

    def _imports_of(self, module: str, path: Path) -> Iterator[Import]:
        if module in self.doors and path.with_suffix(".pyi").exists():
            path = path.with_suffix(".pyi")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names = [(alias.name, "") for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                start = f"{module}.{node.module or ''}".rstrip(".") if node.level else node.module or ""
                names = [self._meant(start, alias.name) for alias in node.names]
            else:
                continue
            for target, name in names:
                if target in self.modules and target != module:
                    yield Import(module, target, name, node.lineno)

    def _meant(self, start: str, name: str) -> tuple[str, str]:
        """What ``from start import name`` means: the module and the name, or a whole module and no name."""
        whole = f"{start}.{name}"
        return (whole, "") if whole in self.modules and whole not in self.doors else (start, name)

    def _at(self, one: Import) -> str:
        return f"{self.modules[one.source].relative_to(self.root)}:{one.line}"

    def room_of(self, module: str) -> str:
        return module if module in self.doors else module.rpartition(".")[0]

    def _foreign(self) -> Iterator[str]:
        """Yields a sentence for each import of a package that the importing one must not know."""
        for link in self.imports:
            mine, other = link.source.split(".")[0], link.target.split(".")[0]
            if other != mine and other not in self.rules.may_import[mine]:
                shared = [p for p in self.rules.may_import[mine] if p in self.rules.may_import[other]]
                better = f"move what both need to {shared[0]}" if shared else "turn the import round"
                yield f"{self._at(link)} imports {other}, which {mine} must not know: {better}."

    def _round_doors(self) -> Iterator[str]:
        """Yields a sentence for each import past a room's door, or of a room by its own door."""
        for link in self.imports:
            room, name = self.room_of(link.target), link.name or link.target.rpartition(".")[2]
            inside = link.source == room or link.source.startswith(f"{room}.")
            if link.target in self.doors:
                if inside and not self._of_door(link):
                    yield (
                        f"{self._at(link)} uses the door of its own room {room}: "
                        f"import {name} from the module that defines it."
                    )
            elif not inside and room not in self.rules.open and not self._shown(room, link):
                yield (
                    f"{self._at(link)} goes round the door of {room}: write `from {room} import {name}`, "
                    f"and name it in the room's __init__ where it is not yet."
                )

    def _shown(self, room: str, one: Import) -> bool:
        """Whether an import is of a whole module that the door of its room shows."""
        return not one.name and any(
            other.source == room and other.target == one.target and not other.name for other in self.imports
        )

    def _of_door(self, one: Import) -> bool:
        """Whether a name is defined in the door itself, or is a room or module in it."""
        lines = ast.parse(self.modules[one.target].read_text(encoding="utf-8")).body
        defined = {name.id for line in lines for name in ast.walk(line) if isinstance(name, ast.Name)}
        return one.name in defined or f"{one.target}.{one.name}" in self.modules

    def _arrows(self) -> dict[str, dict[tuple[str, str], list[Import]]]:
        """Imports by folder, then by the two modules or rooms of it that they join."""
        arrows: dict[str, dict[tuple[str, str], list[Import]]] = defaultdict(lambda: defaultdict(list))
        for link in self.imports:
            source, target = link.source.split("."), link.target.split(".")
            shared = 0
            while shared < min(len(source), len(target)) and source[shared] == target[shared]:
                shared += 1
            if 0 < shared < min(len(source), len(target)):
                arrows[".".join(source[:shared])][source[shared], target[shared]].append(link)
        return arrows

    def _back(self) -> Iterator[str]:
        """Yields a sentence for each import against the stated order of a folder."""
        arrows = self._arrows()
        for folder, order in self.rules.order.items():
            here = {
                module.split(".")[folder.count(".") + 1]
                for module in self.modules
                if module.startswith(f"{folder}.")
            }
            for name in sorted(here - set(order)):
                yield f"{folder}.{name} has no place in the order of {folder}: give it one in rules.toml."
            for name in sorted(set(order) - here):
                yield f"rules.toml orders {folder}.{name}, which is not there: take it out."
            for (source, target), imports in arrows[folder].items():
                if source in order and target in order and order.index(source) < order.index(target):
                    for link in imports:
                        yield (
                            f"{self._at(link)} runs back from {folder}.{source} to {folder}.{target}: "
                            f"move what it needs to {folder}.{source} or to a room before it, "
                            f"or what needs it to {folder}.{target}."
                        )

    def _circles(self) -> Iterator[str]:
        """Yields a sentence for each circle of modules and rooms in folders without a stated order."""
        for folder, arrows in self._arrows().items():
            if folder in self.rules.order:
                continue
            for circle in _circles(set(arrows)):
                ties = [(pair, arrows[pair]) for pair in arrows if set(pair) <= circle]
                (source, target), imports = min(ties, key=lambda tie: len(tie[1]))
                yield (
                    f"{', '.join(sorted(circle))} in {folder} import each other in a circle: "
                    f"{self._at(imports[0])} is the thinnest tie, of {source} to {target}; "
                    "move what it needs below both."
                )

    def _two_meanings(self) -> Iterator[str]:
        """Yields a sentence for each name that a door shows and that is a module of its room as well."""
        for link in self.imports:
            if link.source in self.doors and link.name and f"{link.source}.{link.name}" in self.modules:
                yield f"{link.source} shows {link.name}, which is also a module of it: rename the module."

    def _crowded(self) -> Iterator[str]:
        """Yields a sentence for each folder with too many modules."""
        for room in sorted(self.doors):
            count = sum(self.room_of(module) == room for module in self.modules.keys() - self.doors)
            if count > self.rules.most_modules:
                yield (
                    f"{room} has {count} modules, {count - self.rules.most_modules} too many: "
                    "part it into rooms by what they are for."
                )

    def _past_their_gate(self) -> Iterator[str]:
        """Yields a sentence for each import of a library that one module alone may import."""
        for module, path in sorted(self.modules.items()):
            for line, name in foreign_imports(path.read_text(encoding="utf-8")):
                gate = self.rules.only_imported_by.get(name)
                if gate is not None and module != gate:
                    where = path.relative_to(self.root)
                    yield f"{where}:{line} imports {name}, which only {gate} may: use its functions."

    def _mute(self) -> Iterator[str]:
        """Yields a sentence for each room with a door that does not say what the room is for."""
        for room in sorted(self.doors):
            if not ast.get_docstring(ast.parse(self.modules[room].read_text(encoding="utf-8"))):
                yield f"{room} does not say what it is for: write a paragraph at the top of its __init__."


def foreign_imports(text: str) -> Iterator[tuple[int, str]]:
    """Yields the line and the top package of each import in a module, calls of ``import_module`` included."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or ""] if not node.level else []
        elif isinstance(node, ast.Call) and node.args:
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            first = getattr(node.args[0], "value", None)
            names = [first] if called in ("import_module", "__import__") and isinstance(first, str) else []
        else:
            continue
        for name in names:
            yield node.lineno, name.partition(".")[0]


def _circles(arrows: set[tuple[str, str]]) -> list[set[str]]:
    """Sets of nodes that reach one another, two or more each."""
    after: dict[str, set[str]] = defaultdict(set)
    for source, target in arrows:
        after[source].add(target)

    def reached(start: str) -> set[str]:
        seen, queue = set(), [start]
        while queue:
            for node in after[queue.pop()] - seen:
                seen.add(node)
                queue.append(node)
        return seen

    reach = {node: reached(node) for pair in arrows for node in pair}
    circles: list[set[str]] = []
    for node in sorted(reach):
        circle = {other for other in reach[node] if node in reach[other]} | {node}
        if len(circle) > 1 and circle not in circles:
            circles.append(circle)
    return circles


@cache
def project_house() -> House:
    """The house of this project by its own rules, read once."""
    here = Path(__file__)
    return House(here.parents[2], Rules.read(here.with_name("rules.toml")))
