"""Reads the packages of the project: their modules, imports and docstrings.

``pyproject.toml`` holds other rules: import-linter checks the order of imports, and ruff the presence of
docstrings and the number of statements of a function.
"""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = {
    "enliven": "shared/enliven",
    "enliven_edge": "edge/enliven_edge",
    "enliven_viewer": "viewer/enliven_viewer",
    "enliven_synthesis": "synthesis/enliven_synthesis",
}
"""Folder of each top-level package."""
MAX_MODULES = 20
"""Maximum number of modules in a folder. A package with more has more than one purpose."""
ONLY_IMPORTED_BY = {"onnxruntime": "enliven_edge.onnx_runtime"}
"""Libraries that only one module may import: this module switches their telemetry off."""


@dataclass
class SourceTree:
    """The modules of all packages.

    Attributes:
        root: folder of the project.
        packages: names of all packages, at any depth.
        modules: file of each module and package, by dotted name.
    """

    root: Path = ROOT
    folders: dict[str, str] = field(default_factory=lambda: dict(PACKAGES))
    packages: set[str] = field(default_factory=set)
    modules: dict[str, Path] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for package, folder in self.folders.items():
            for path in sorted((self.root / folder).rglob("*.py")):
                parts = [package, *path.relative_to(self.root / folder).with_suffix("").parts]
                if parts[-1] == "__init__":
                    parts.pop()
                    self.packages.add(".".join(parts))
                self.modules[".".join(parts)] = path

    def package_of(self, module: str) -> str:
        """Returns the package that contains a module, or the package itself."""
        return module if module in self.packages else module.rpartition(".")[0]

    def public_names(self, package: str) -> dict[str, str]:
        """Returns the public names of a package's stub (without modules), each with the module that defines
        it.
        """
        stub = self.modules[package].with_suffix(".pyi")
        lines = ast.parse(stub.read_text(encoding="utf-8")).body if stub.exists() else []
        imports = [line for line in lines if isinstance(line, ast.ImportFrom) and line.module]
        return {a.asname or a.name: f"{package}.{line.module}" for line in imports for a in line.names}

    def violations(self) -> Iterator[str]:
        """Yields a sentence with advice for each package or import that breaks a rule."""
        for package in sorted(self.packages):
            count = sum(self.package_of(module) == package for module in self.modules.keys() - self.packages)
            if count > MAX_MODULES:
                advice = "divide it into packages by their purpose"
                yield f"{package} has {count} modules, {count - MAX_MODULES} too many: {advice}."
            for name in self.public_names(package):
                if f"{package}.{name}" in self.modules:
                    yield f"{package} exports {name}, which is also a module of it: rename the module."
        for module, path in sorted(self.modules.items()):
            for line, name in external_imports(path, *ONLY_IMPORTED_BY):
                allowed = ONLY_IMPORTED_BY.get(name)
                if allowed is not None and module != allowed:
                    where = path.relative_to(self.root)
                    yield f"{where}:{line} imports {name}, which only {allowed} may: use its functions."


def walk_source(path: Path, *words: str) -> Iterator[ast.AST]:
    """Yields all nodes of a Python file, if it contains one of the words.

    Without words, every file is parsed. This takes seconds for the whole project.
    """
    text = path.read_text(encoding="utf-8")
    yield from list_nodes(ast.parse(text)) if not words or any(map(text.__contains__, words)) else ()


def list_nodes(tree: ast.AST) -> list[ast.AST]:
    """Returns a tree and all nodes below it, in the order of ``ast.walk`` but in a third of its time."""
    nodes = [tree]
    for node in nodes:
        for name in node._fields:
            value = getattr(node, name, None)
            if isinstance(value, list):
                nodes += [each for each in value if isinstance(each, ast.AST)]
            elif isinstance(value, ast.AST):
                nodes.append(value)
    return nodes


def external_imports(path: Path, *words: str) -> Iterator[tuple[int, str]]:
    """Yields line and top-level package of each import in a file, including calls of ``import_module``.

    For ``words``, see :func:`walk_source`.
    """
    for node in walk_source(path, *words):
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


def import_levels() -> dict[str, list[list[str]]]:
    """Returns the levels of each folder with a contract in ``pyproject.toml``, the lowest first."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]
    return {
        container: [level.split(" | ") for level in reversed(contract["layers"])]
        for contract in settings["contracts"]
        for container in contract.get("containers", ())
    }


@cache
def project_tree() -> SourceTree:
    """Returns the packages of this project, read once."""
    return SourceTree()
