"""Tests that packages have one purpose, a limited size and an import order, and that violations are
reported.
"""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
from source_tree import (
    ONLY_IMPORTED_BY,
    PACKAGES,
    ROOT,
    SourceTree,
    external_imports,
    import_levels,
    project_tree,
    walk_source,
)

LINT = [
    sys.executable,
    "-c",
    "from importlinter.cli import lint_imports_command as c; c()",
    "--no-cache",
]
MAX_LEVELS = 9
"""Maximum number of levels of the library's packages."""


def lint(*arguments: str, folder: Path = ROOT) -> tuple[int, str]:
    """Checks the contracts of a folder. Returns the exit status and the report."""
    done = subprocess.run([*LINT, *arguments], cwd=folder, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def test_imports_keep_all_contracts():
    status, report = lint()
    assert status == 0, report
    assert "18 kept" in report


def test_library_names_no_module_of_a_program():
    """import-linter does not see an import by a string. Programs register by entry points instead."""
    named = [
        f"{path}:{node.lineno}: {node.value}"
        for module, path in project_tree().modules.items()
        if module.startswith("enliven.")
        for node in walk_source(path, "enliven_")
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and re.fullmatch(r"enliven_(edge|viewer|synthesis)\.[\w.:]+", node.value)
    ]
    assert not named, named


def test_library_has_few_levels():
    tree = project_tree()
    levels = [
        level for level in import_levels()["enliven"] if any(f"enliven.{m}" in tree.packages for m in level)
    ]
    first = next(k for k, level in enumerate(levels) if "meshes" in level)
    assert len(levels) - first <= MAX_LEVELS, levels


def test_editor_of_the_studio_has_few_methods():
    """New functions on the project belong to a feature, or to a module that takes the editor."""
    path = ROOT / "viewer" / "enliven_viewer" / "studio" / "editor" / "editor.py"
    (editor,) = (
        node
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef) and node.name == "Editor"
    )
    functions = [node for node in editor.body if isinstance(node, ast.FunctionDef)]
    methods = [f.name for f in functions if not f.name.startswith("_") and not f.decorator_list]
    assert len(methods) < 20, methods


MAX_RIG_TESTS = 13
"""Maximum number of tests for one type of rig outside the modules that convert between rigs and data."""
_RIG_TYPES = {"RiggedCharacter", "GraphCharacter", "ExampleCharacter"}
_RIG_CONVERTERS = ("enliven/formats", "enliven/wire", "enliven_viewer/render", "enliven/document")


def test_few_modules_test_the_type_of_a_rig():
    """Differences between rigs belong to RigBase and RigEdits, so that a further rig is one package."""
    places = []
    for folder in PACKAGES.values():
        for path in (ROOT / folder).rglob("*.py"):
            if not any(part in path.as_posix() for part in _RIG_CONVERTERS):
                for node in walk_source(path, *_RIG_TYPES):
                    is_call = isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance"
                    is_compared = isinstance(node, ast.Compare) and ".kind" in ast.unparse(node)
                    if is_call or is_compared:
                        names = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
                        if names & _RIG_TYPES:
                            places.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert len(places) <= MAX_RIG_TESTS, places


CONTRACTS = """
[tool.importlinter]
root_packages = ["core", "edge"]
[[tool.importlinter.contracts]]
name = "Programs"
type = "layers"
layers = ["edge", "core"]
[[tool.importlinter.contracts]]
name = "Cycles"
type = "acyclic_siblings"
ancestors = ["core", "edge"]
[[tool.importlinter.contracts]]
name = "Levels"
type = "layers"
containers = ["edge"]
exhaustive = true
layers = ["loop", "tracking", "sensing"]
"""
FILES = {
    "core/__init__.py": '"""Mathematics."""',
    "core/arrays.py": "",
    "edge/__init__.py": '"""The edge."""',
    "edge/loop.py": "from edge.tracking.tracker import Tracker",
    "edge/sensing/__init__.py": '"""Frames."""',
    "edge/sensing/__init__.pyi": "from .frame import Frame as Frame",
    "edge/sensing/frame.py": "import core.arrays\nFrame = 1",
    "edge/tracking/__init__.py": '"""People."""',
    "edge/tracking/tracker.py": "from edge.sensing.frame import Frame\nTracker = Frame",
}


def write_files(root: Path, changes: dict[str, str]) -> None:
    """Writes a small project with some files changed or added."""
    for name, text in {"pyproject.toml": CONTRACTS, **FILES, **changes}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)


@pytest.mark.parametrize(
    ("changes", "broken"),
    [
        ({}, ""),
        ({"core/arrays.py": "def f():\n    from edge.sensing.frame import Frame"}, "Programs"),
        ({"edge/sensing/frame.py": "import edge.tracking.tracker\nFrame = 1"}, "Levels"),
        ({"edge/late.py": ""}, "Levels"),
        (
            {"edge/tracking/a.py": "import edge.tracking.b", "edge/tracking/b.py": "import edge.tracking.a"},
            "Cycles",
        ),
    ],
    ids=["in order", "in a function", "upwards", "without a level", "in a cycle"],
)
def test_contracts_find_a_forbidden_import(tmp_path, changes, broken):
    write_files(tmp_path, changes)
    status, report = lint(folder=tmp_path)
    assert bool(status) == bool(broken), report
    assert not broken or f"{broken} BROKEN" in report, report


def test_packages_keep_all_rules():
    assert "\n".join(project_tree().violations()) == ""


def test_every_package_is_read():
    tree = project_tree()
    assert PACKAGES.keys() <= tree.packages and len(tree.modules) > 500


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({f"edge/tracking/m{k}.py": "" for k in range(20)}, "edge.tracking has 21 modules, 1 too many"),
        ({"edge/sensing/Frame.py": ""}, "edge.sensing exports Frame, which is also a module of it"),
        (
            {"edge/loop.py": "def f():\n    from onnxruntime.parts import A"},
            "edge/loop.py:2 imports onnxruntime, which only enliven_edge.onnx_runtime may: use its functions",
        ),
        (
            {"edge/loop.py": "import importlib\nA = importlib.import_module('onnxruntime')"},
            "edge/loop.py:2 imports onnxruntime, which only enliven_edge.onnx_runtime may: use its functions",
        ),
    ],
)
def test_a_violation_is_reported_with_advice(tmp_path, changes, message):
    write_files(tmp_path, changes)
    (violation,) = SourceTree(tmp_path, {"core": "core", "edge": "edge"}).violations()
    assert violation.startswith(message)


def test_no_other_file_imports_a_library_with_telemetry():
    for folder in ("scripts", "tests", "docs", "firmware_configs"):
        for path in (ROOT / folder).rglob("*.py"):
            names = {name for _, name in external_imports(path, *ONLY_IMPORTED_BY)}
            assert not names & ONLY_IMPORTED_BY.keys(), path


def test_helpers_import_no_module_of_one_test_folder():
    """Only tests/helpers and tests/conventions are on the path of every test."""
    tests = ROOT / "tests"
    shared = {path.stem for folder in ("helpers", "conventions") for path in (tests / folder).rglob("*.py")}
    elsewhere = {path.stem for path in tests.rglob("*.py")} - shared
    for path in (tests / "helpers").rglob("*.py"):
        names = {name for _, name in external_imports(path)}
        assert not names & elsewhere, path


def test_test_files_make_contexts_of_zeromq_by_the_helper():
    """A forgotten context can block a later test for ever. Benchmarks and the soak test run in their own
    processes.
    """
    tests = ROOT / "tests"
    programs = (tests / "benchmarks", tests / "soak", tests / "helpers")
    for path in tests.rglob("*.py"):
        if not any(path.is_relative_to(folder) for folder in programs) and path != Path(__file__):
            assert "zmq.Context(" not in path.read_text(encoding="utf-8"), (
                f"{path}: use zmq_contexts.make_context"
            )


def test_decoding_errors_are_caught_completely():
    """Damaged JSON also raises UnicodeDecodeError and RecursionError, which are not errors of msgspec."""
    complete = {"ValueError", "DAMAGE"}
    for folder in PACKAGES.values():
        for path in (ROOT / folder).rglob("*.py"):
            for node in walk_source(path, "DecodeError", "MsgspecError"):
                if isinstance(node, ast.ExceptHandler) and node.type is not None:
                    caught = {n.attr if isinstance(n, ast.Attribute) else n.id for n in _names(node.type)}
                    is_partial = caught & {"DecodeError", "MsgspecError"} and not caught & complete
                    assert not is_partial, f"{path}:{node.lineno}: catch enliven.files.DECODE_ERRORS"


def _names(expression: ast.expr) -> list[ast.Name | ast.Attribute]:
    """Returns the exceptions that an except clause names."""
    parts = expression.elts if isinstance(expression, ast.Tuple) else [expression]
    values = [part.value if isinstance(part, ast.Starred) else part for part in parts]
    return [value for value in values if isinstance(value, (ast.Name, ast.Attribute))]


def test_architecture_page_is_current():
    sys.path.insert(0, str(ROOT / "scripts"))
    import architecture

    page = architecture.PAGE.read_text(encoding="utf-8")
    assert page == architecture.make_page(page), "run .venv/bin/python scripts/architecture.py"
    assert page.count("<!-- end -->") == 11


@pytest.mark.parametrize(
    ("at", "message"),
    [
        ("enliven_edge.service:Edge.walk", "enliven_edge.service has no function or class Edge.walk"),
        ("enliven_edge.nowhere:walk", "the module enliven_edge.nowhere does not exist"),
        ("viewer/none.vert", "viewer/none.vert does not exist"),
        ("enliven_viewer.studio.tools.cut:CutTool", "no earlier file of the trace contains 'CutTool'"),
    ],
)
def test_wrong_call_trace_is_refused(at, message):
    sys.path.insert(0, str(ROOT / "scripts"))
    import traces

    start = {"at": "enliven_edge.service:Edge.step", "by": ""}
    with pytest.raises(ValueError, match=message):
        traces.table(project_tree(), traces.Trace("somewhere", 9, [start, {"at": at}]))


def test_stubs_export_each_name_under_its_own_name():
    stubs = [path for folder in PACKAGES.values() for path in (ROOT / folder).rglob("*.pyi")]
    assert 8 <= len(stubs) <= 12, "a package has a stub if scripts and plug-ins use it"
    for path in stubs:
        if path.parent == ROOT / "shared" / "enliven":
            continue  # This list of names is also documentation.
        for line in ast.parse(path.read_text(encoding="utf-8")).body:
            named = isinstance(line, ast.ImportFrom) and all(a.asname == a.name for a in line.names)
            assert named, f"{path.relative_to(ROOT)}:{line.lineno}: write `from .module import name as name`"
