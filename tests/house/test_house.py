"""The house keeps its rules, and each rule refuses what breaks it."""

import ast
import sys
from pathlib import Path

import pytest
from house import House, Rules, foreign_imports, project_house

ROOT = Path(__file__).parents[2]
RULES = Rules.read(Path(__file__).with_name("rules.toml"))


def test_no_import_breaks_a_rule():
    assert "\n".join(project_house().broken()) == ""


def test_nothing_is_let_through():
    assert RULES.exceptions == []


def test_every_package_is_seen():
    house = project_house()
    assert {package for package in RULES.packages if package in house.doors} == set(RULES.packages)
    assert len(house.modules) > 500 and len(house.imports) > 2000


SMALL = Rules(
    most_modules=3,
    packages={"core": "core", "edge": "edge"},
    may_import={"core": [], "edge": ["core"]},
    open=["core", "edge"],
    order={"edge": ["sensing", "tracking", "loop"]},
    only_imported_by={"chatty": "edge.loop"},
)
FILES = {
    "core/__init__.py": '"""Mathematics."""',
    "core/arrays.py": "",
    "edge/__init__.py": '"""The edge."""',
    "edge/loop.py": "from edge.tracking import Tracker",
    "edge/sensing/__init__.py": '"""Frames."""',
    "edge/sensing/__init__.pyi": "from .frame import Frame",
    "edge/sensing/frame.py": "import core.arrays\nFrame = 1",
    "edge/tracking/__init__.py": '"""People."""\nfrom edge.tracking.tracker import Tracker',
    "edge/tracking/tracker.py": "from edge.sensing import Frame\nTracker = Frame",
}


def house_of(root: Path, changes: dict[str, str]) -> list[str]:
    """What is said of a small house with some files changed or added."""
    for name, text in {**FILES, **changes}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    return House(root, SMALL).broken()


def test_a_house_in_order_is_let_be(tmp_path):
    assert house_of(tmp_path, {}) == []


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"core/arrays.py": "def f():\n    from edge.sensing import Frame"},
            "core/arrays.py:2 imports edge, which core must not know: turn the import round.",
        ),
        (
            {"edge/loop.py": "from edge.tracking.tracker import Tracker"},
            "edge/loop.py:1 goes round the door of edge.tracking: write `from edge.tracking import T",
        ),
        (
            {"edge/loop.py": "import edge.tracking.tracker"},
            "edge/loop.py:1 goes round the door of edge.tracking: write `from edge.tracking import t",
        ),
        (
            {"edge/tracking/fit.py": "from edge.tracking import Tracker"},
            "edge/tracking/fit.py:1 uses the door of its own room edge.tracking: import Tracker from",
        ),
        (
            {"edge/sensing/frame.py": "from edge.tracking import Tracker\nFrame = 1"},
            "edge/sensing/frame.py:1 runs back from edge.sensing to edge.tracking: move what it needs",
        ),
        (
            {"edge/late.py": ""},
            "edge.late has no place in the order of edge: give it one",
        ),
        (
            {
                "edge/tracking/a.py": "from edge.tracking import b",
                "edge/tracking/b.py": "import edge.tracking.a",
            },
            "a, b in edge.tracking import each other in a circle: edge/tracking/",
        ),
        (
            {f"edge/tracking/{name}.py": "" for name in "abc"},
            "edge.tracking has 4 modules, 1 too many",
        ),
        (
            {"edge/sensing/Frame.py": "", "edge/tracking/tracker.py": "Tracker = 1"},
            "edge.sensing shows Frame, which is also a module of it",
        ),
        (
            {"edge/tracking/tracker.py": "def f():\n    from chatty.parts import A\nTracker = 1"},
            "edge/tracking/tracker.py:2 imports chatty, which only edge.loop may: use its functions",
        ),
        (
            {"edge/tracking/tracker.py": "import importlib\nTracker = importlib.import_module('chatty')"},
            "edge/tracking/tracker.py:2 imports chatty, which only edge.loop may: use its functions",
        ),
        (
            {"edge/sensing/__init__.py": "import lazy_loader"},
            "edge.sensing does not say what it is for",
        ),
    ],
)
def test_what_breaks_a_rule_is_refused_with_a_way_out(tmp_path, changes, said):
    complaints = house_of(tmp_path, changes)
    assert len(complaints) == 1 and complaints[0].startswith(said)


def test_the_one_module_may_import_its_library(tmp_path):
    loop = "import chatty\nfrom edge.tracking import Tracker"
    assert house_of(tmp_path, {"edge/loop.py": loop}) == []


def test_no_other_file_imports_a_library_with_telemetry():
    for folder in ("scripts", "tests", "docs", "firmware_configs"):
        for path in (ROOT / folder).rglob("*.py"):
            names = {name for _, name in foreign_imports(path.read_text(encoding="utf-8"))}
            assert not names & RULES.only_imported_by.keys(), path


def test_helpers_import_no_module_of_one_folder_of_tests():
    """Only tests/helpers is on every test's path: another folder's is there once its tests were collected."""
    tests = ROOT / "tests"
    shared_modules = {path.stem for folder in ("helpers", "house") for path in (tests / folder).rglob("*.py")}
    elsewhere = {path.stem for path in tests.rglob("*.py")} - shared_modules
    for path in (tests / "helpers").rglob("*.py"):
        names = {name for _, name in foreign_imports(path.read_text(encoding="utf-8"))}
        assert not names & elsewhere, path


def test_a_module_that_a_door_shows_may_be_imported_whole(tmp_path):
    door = '"""People."""\nfrom edge.tracking import model\nfrom edge.tracking.tracker import Tracker'
    changes = {"edge/tracking/__init__.py": door, "edge/tracking/model.py": ""}
    assert house_of(tmp_path, {**changes, "edge/loop.py": "from edge.tracking import model"}) == []


def test_an_order_that_names_what_is_not_there_is_said(tmp_path):
    for name, text in FILES.items():
        if not name.startswith("edge/loop"):
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(text)
    assert House(tmp_path, SMALL).broken() == [
        "rules.toml orders edge.loop, which is not there: take it out."
    ]


def test_the_page_on_the_architecture_is_that_of_the_code():
    sys.path.insert(0, str(ROOT / "scripts"))
    import architecture

    page = architecture.PAGE.read_text(encoding="utf-8")
    assert page == architecture.written(page), "run .venv/bin/python scripts/architecture.py"
    assert page.count("<!-- end -->") == 9


@pytest.mark.parametrize(
    ("at", "said"),
    [
        ("enliven_edge.service:Edge.walk", "enliven_edge.service has no Edge.walk"),
        ("enliven_edge.nowhere:walk", "there is no module enliven_edge.nowhere"),
        ("viewer/none.vert", "viewer/none.vert is not there"),
        ("enliven_viewer.studio.tools.cut:CutTool", "no file before it in the walk says 'CutTool'"),
    ],
)
def test_a_walk_that_the_code_no_longer_goes_is_refused(at, said):
    sys.path.insert(0, str(ROOT / "scripts"))
    import walks

    start = {"at": "enliven_edge.service:Edge.step", "by": ""}
    with pytest.raises(ValueError, match=said):
        walks.table(project_house(), walks.Walk("somewhere", 9, [start, {"at": at}]))


def test_a_door_names_each_thing_once_as_itself():
    doors = [path for package in RULES.packages.values() for path in (ROOT / package).rglob("__init__.pyi")]
    assert len(doors) > 80
    for path in doors:
        if path.parent == ROOT / "shared" / "enliven":
            continue  # the public face is also read by people, as a list
        for line in ast.parse(path.read_text(encoding="utf-8")).body:
            named = isinstance(line, ast.ImportFrom) and all(a.asname == a.name for a in line.names)
            assert named, f"{path.relative_to(ROOT)}:{line.lineno}: write `from .module import name as name`"
