"""Tests that every script in examples/ runs unchanged, is short, and imports only public names."""

import ast
import runpy
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from blocks import ROOT
from own_files import write_models
from PIL import Image

from enliven.wire import free_ports

SCRIPTS = sorted((ROOT / "examples").glob("*.py"))
MOST_LINES = 40
ARGUMENTS = {
    "retarget_model": ("TRAFFIC.bvh", "HORSE.glb"),
    "match_limbs": ("SPIDER.glb",),
    "walking_dog": ("DOG.glb",),
}
"""Files that are passed to the scripts. The tests create them."""
TILE, GAP = 420, 10
"""Side length of an image on a contact sheet, and the gap between two images, pixels."""
NEEDS_EDGE = "listen_to_edge"
NEEDS_PHYSICS = "knock_over"
MAX_DIFFERENCE = 12.0
"""Maximum mean difference (of 255) between the first image and the stored film's. Other machines draw
slightly differently.
"""


@pytest.fixture(scope="module")
def models(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("models")
    write_models(folder)
    with pytest.MonkeyPatch.context() as patch:
        run(ROOT / "examples" / "rigged_dog.py", ["-o", "DOG.glb"], folder, patch)
    return folder


def run(script: Path, arguments: list[str], folder: Path, monkeypatch) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "argv", [script.name, *arguments])
    runpy.run_path(str(script), run_name="__main__")


@pytest.mark.parametrize(
    "script", [path for path in SCRIPTS if path.stem != NEEDS_EDGE], ids=lambda one: one.stem
)
@pytest.mark.slow
def test_a_script_runs_and_draws_its_pictures(script, models, tmp_path, monkeypatch, capsys):
    if script.stem == NEEDS_PHYSICS:
        pytest.importorskip("mujoco", reason="mujoco is not installed (the extra 'physics')")
    run(script, [str(models / name) for name in ARGUMENTS.get(script.stem, ())], tmp_path, monkeypatch)
    pictures, films = sorted(tmp_path.glob("*.png")), sorted(tmp_path.glob("*.webp"))
    assert [film.stem for film in films] in ([], [script.stem])
    for film in films:
        with Image.open(film) as drawn, Image.open(ROOT / "docs" / "gallery" / film.name) as stored:
            assert abs(drawn.n_frames - stored.n_frames) <= 2 and drawn.size == stored.size
            first, second = (np.asarray(image.convert("RGB"), float) for image in (drawn, stored))
        assert np.abs(first - second).mean() < MAX_DIFFERENCE, "make the film of docs/gallery again"
    assert pictures or films or capsys.readouterr().out.count("\n") >= 3, "it shows something, or prints it"
    for path in pictures:
        assert path.stem.startswith(script.stem)
        sheet = np.asarray(Image.open(path).convert("L"), float)
        wide = TILE + GAP
        tiles = [sheet[-TILE - GAP : -40, n * wide + GAP :][:, :TILE] for n in range(sheet.shape[1] // wide)]
        assert len(tiles) == 4 and all((a != b).mean() > 2e-4 for a, b in pairwise(tiles)), "it moves"


@pytest.mark.slow
def test_a_script_follows_a_running_edge(tmp_path, monkeypatch, capsys):
    script, (port, control) = ROOT / "examples" / f"{NEEDS_EDGE}.py", free_ports()[:2]
    words = ["--sensor", "synthetic", "--port", str(port), "--control-port", str(control), "--seconds", "300"]
    edge = subprocess.Popen([sys.executable, "-m", "enliven", "edge", *words], stderr=subprocess.DEVNULL)
    try:
        for seconds in ("3", "10", "10", "30", "30", "60", "60"):  # kernels may have to be compiled first
            run(script, [f"127.0.0.1:{port}:{control}", seconds], tmp_path, monkeypatch)
            if "characters: ['chair']" in capsys.readouterr().out:
                return
        pytest.fail("the chair of the edge was not heard")
    finally:
        edge.terminate()
        edge.wait(30)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda one: one.stem)
def test_a_script_is_short_and_imports_no_private_name(script):
    text = script.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= MOST_LINES
    tree = ast.parse(text)
    assert ast.get_docstring(tree), "it says what it does"
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            assert node.module
            assert not any(
                part.startswith("_")
                for part in [*node.module.split("."), *(alias.name for alias in node.names)]
            )


def test_the_list_names_each_script_once_with_its_sentence():
    listed = (ROOT / "examples" / "README.md").read_text(encoding="utf-8")
    for script in SCRIPTS:
        assert listed.count(f"[{script.name}]({script.name})") == 1, script.name
