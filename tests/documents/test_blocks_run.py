"""Tests that every code block of the documents runs unchanged in a folder with only the user's own files."""

from __future__ import annotations

import runpy
import tomllib
from pathlib import Path

import pytest
from blocks import PAGES, ROOT, Block, blocks_of
from own_files import make_own_files

import enliven.commands.run as run_command
import enliven_viewer.commands.studio as studio_command
import enliven_viewer.studio.window.window as studio_window
from enliven import cli
from enliven.kiosk.profile import KioskProfile
from enliven.mapping.plan_file import read_plan
from enliven.settings import load_settings
from enliven_edge.settings import EdgeSettings
from enliven_viewer.settings import ViewerSettings
from enliven_viewer.studio.settings import StudioSettings

BLOCKS = [block for page in PAGES for block in blocks_of(page)]
BOUNDS = {
    "edge": ["--seconds", "0.6", "--possess-at", "0.3", "--speed", "0", "--port", "0"],
    "replay": ["--fast", "--port", "0"],
    "view": ["--film", "bounded.mp4", "--seconds", "0.1", "--size", "160x90"],
    "inspect": ["--frames", "3"],
    "synthesize": ["--width", "80", "--level", "1"],
    "record": ["--set", "width=80", "--seconds", "5"],
    "studio": ["--seconds", "0.1"],
    "scan": ["--voxel", "16", "--triangles", "4000"],
    "examples fit": ["--end", "0.1"],
}
"""Options that are added to a command line so that it ends soon.

An edge ends only after a body is attached. If an option is given twice, the last value counts.
"""
SLOW_PAGES = {
    "docs/blender.md",
    "docs/live-outputs.md",
    "docs/matching.md",
    "docs/performing.md",
    "docs/physics.md",
    "docs/possession.md",
    "docs/puppets.md",
    "docs/reading-files.md",
    "docs/retargeting.md",
    "docs/scanning.md",
    "docs/tour.md",
    "docs/tutorials/example-driven-character.md",
    "docs/tutorials/first-chair.md",
    "docs/tutorials/library-model.md",
    "docs/tutorials/scan-to-character.md",
    "docs/tutorials/two-cameras.md",
    "edge/README.md",
}
"""Documents with commands that take more than a second of processor time."""
TELLS = {"doctor": 4, "examples": 3}
"""Exit codes of commands that report missing parts on this machine, or in a session without poses."""


def pages_of(kind: str) -> list[Path]:
    """Returns the documents that contain blocks of this kind that must run."""
    return [page for page in PAGES if runnable(page, kind)]


def runnable(page: Path, kind: str) -> list[Block]:
    return [block for block in BLOCKS if block.page == page and block.kind == kind and not block.reason]


def named(pages: list[Path]):
    """Parametrises a test by documents. It marks ``SLOW_PAGES`` as slow."""
    names = [str(page.relative_to(ROOT)) for page in pages]
    marks = [[pytest.mark.slow] if name in SLOW_PAGES else [] for name in names]
    parameters = [
        pytest.param(page, id=name, marks=mark) for page, name, mark in zip(pages, names, marks, strict=True)
    ]
    return pytest.mark.parametrize("page", parameters)


def test_every_block_is_run_or_states_a_reason():
    assert [
        str(b) for b in BLOCKS if b.kind not in ("shell", "python", "toml", "mermaid") and not b.reason
    ] == []
    assert sum(not block.reason for block in BLOCKS) > 0.6 * len(BLOCKS), (
        "only what needs hardware is left out"
    )


@pytest.fixture(scope="module")
def own(tmp_path_factory) -> Path:
    """Creates a folder with the files that are named in capitals, and the folder that is shipped with
    them.
    """
    folder = tmp_path_factory.mktemp("own")
    make_own_files(folder)
    (folder / "firmware_configs").symlink_to(ROOT / "firmware_configs")
    return folder


@pytest.fixture
def place(own, tmp_path, monkeypatch) -> Path:
    """Creates an empty working folder from which the user's own files can be found."""
    for file in own.iterdir():
        (tmp_path / file.name).symlink_to(file)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path


@pytest.fixture
def without_processes(monkeypatch):
    """Runs the edge of ``enliven run`` in this process, and ends the studio's window at once."""

    def here(processes) -> int:
        edge, view = (list(process.arguments) for process in processes)
        edge[edge.index("--wait-for-viewer") + 1] = "0"
        from test_command_lines import parse

        assert parse(view).params["edge"] == ["127.0.0.1"]
        return cli.run([*edge, *BOUNDS["edge"]])

    class Closed:
        def __init__(self, workspace, opening, outputs) -> None:
            self.workspace = workspace

        def run(self, seconds: float | None = None) -> None:
            assert self.workspace.editor is not None

    monkeypatch.setattr(run_command, "run_together", here)
    monkeypatch.setattr(studio_command, "has_display", lambda: True)
    monkeypatch.setattr(studio_window, "StudioWindow", Closed)


def runs_on_another_page(page: Path, words: list[str]) -> bool:
    """Returns True if a README command writes no file and is already run as part of another page."""
    is_output = {"-o", "--record"} & set(words)
    others = (block for block in BLOCKS if block.page != page and block.kind == "shell" and not block.reason)
    return page == ROOT / "README.md" and not is_output and any(words in block.commands for block in others)


def replace_key_poses(session: Path, poses: str) -> None:
    """Writes the key poses of a page into a session, as the page asks its reader to do."""
    before, _, rest = session.read_text().partition("[[pose]]")
    after = rest[rest.index("[symmetry]") :]
    session.write_text(f"{before}{poses}\n{after}")


@named(pages_of("shell"))
def test_the_commands_of_a_document_run(page, place, without_processes, monkeypatch, capsys):
    for block in (block for block in BLOCKS if block.page == page and not block.reason):
        if block.kind == "toml" and "[[pose]]" in block.text and page.parent.name == "tutorials":
            replace_key_poses(place / "cactus.toml", block.text)
        for words in block.commands if block.kind == "shell" else []:
            if words[0] == ".venv/bin/python" and "-o" in words:
                monkeypatch.setattr("sys.argv", words[1:])
                runpy.run_path(str(ROOT / words[1]), run_name="__main__")
            if words[0] != "enliven" or "COMMAND" in words or runs_on_another_page(page, words):
                continue
            bounds = BOUNDS.get(words[1]) or BOUNDS.get(" ".join(words[1:3]), [])
            code = cli.run([*words[1:], *bounds])
            assert code in (0, TELLS.get(words[1])), f"{block}: {' '.join(words)}: {capsys.readouterr().err}"


ELSEWHERE = {
    "examples.md": "tests/shared/examples/test_examples_doc.py",
    "surgery.md": "tests/shared/modeling/test_surgery_doc.py",
}
"""Documents with their own test, which runs their code and also checks its output."""


def test_separate_tests_mention_their_pages():
    for page, test in ELSEWHERE.items():
        assert page in (ROOT / test).read_text()


@named([page for page in pages_of("python") if page.name not in ELSEWHERE])
@pytest.mark.slow
def test_the_code_of_a_document_runs(page, place, capsys):
    names: dict[str, object] = {}
    for block in runnable(page, "python"):
        exec(compile("\n" * (block.line - 1) + block.text, str(page), "exec"), names)


@pytest.mark.parametrize("block", [b for b in BLOCKS if b.kind == "toml" and not b.reason], ids=str)
def test_the_settings_of_a_document_are_settings(block, tmp_path):
    values = tomllib.loads(block.text)
    path = tmp_path / "page.toml"
    path.write_text(block.text)
    if "chain" in values:
        assert len(read_plan(path).chains) == len(values["chain"])
    elif block.page.parent.name == "tutorials":
        assert all({"take", "time", "moves"} <= set(pose) for pose in values["pose"])
    elif block.page.name in ("health.md", "kiosk.md", "technician.md"):
        assert load_settings(KioskProfile, path) != KioskProfile()
    elif block.page.name == "studio.md":
        assert load_settings(StudioSettings, path).width == values["width"]
    elif "render" in values:
        assert load_settings(ViewerSettings, path).render != ViewerSettings().render
    elif "film" in values:
        assert load_settings(ViewerSettings, path).film.encoder == values["film"]["encoder"]
    elif block.page.name == "examples.md":
        assert {"mesh", "take"} <= set(values)  # tests/shared/examples/test_examples_doc.py plays it
    else:
        assert load_settings(EdgeSettings, path) != EdgeSettings()
