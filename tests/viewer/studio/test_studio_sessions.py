"""Tests of the sessions in the paper with the studio's own tools, without a window, and of undo."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from studio_driver import Action, Click, Do, Drag, HeadlessStage, Key, Pixel, play

from enliven.document.project import are_identical
from enliven.motion.layers.evaluate import Player
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.workspace.workspace import Workspace

FILMS = Path(__file__).parents[2] / "benchmarks" / "examples" / "session_films.py"


@pytest.fixture(scope="module")
def films() -> ModuleType:
    """Returns the module of the script that films the sessions."""
    spec = importlib.util.spec_from_file_location("session_films", FILMS)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def played(films: ModuleType, name: str, folder: Path) -> Workspace:
    workspace = Workspace.new(Editor(films.SIZE), folder)
    play(list(films.SESSIONS[name]()), HeadlessStage(workspace))
    bad = [toast.text for toast in workspace.editor.toasts.shown if toast.is_error]
    assert not bad, bad
    return workspace


def closed(faces: np.ndarray) -> bool:
    """Returns True if every edge occurs once in each direction."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).tolist()
    return len({tuple(e) for e in edges}) == len(edges) and {(b, a) for a, b in edges} == {
        tuple(e) for e in edges
    }


@pytest.mark.slow
def test_figure_6_keeps_every_motion(films, tmp_path) -> None:
    workspace = played(films, "figure6", tmp_path)
    names = workspace.editor.history.names
    assert [name.split()[0] for name in names].count("add") == 2
    surgery = [name for name in names if name.split()[0] in ("merge", "cut")]
    assert surgery == ["merge chain 2", "cut", "merge chain 2"]
    project = workspace.editor.project
    assert list(project.shapes) == ["chain"] and closed(project.shapes["chain"].mesh.faces)
    turns, _ = Player(project, "chain").sample(np.array([0.0, 1.0]))
    tip = project.shapes["chain"].skeleton.index("a1")
    swung = 2 * np.arccos(np.clip(abs(turns[0, tip] @ turns[1, tip]), 0, 1))
    assert swung == pytest.approx(np.pi / 2, abs=1e-6), "the whole quarter turn, three bones later"


@pytest.mark.slow
def test_the_squid_is_one_closed_surface_with_six_moving_tentacles(films, tmp_path) -> None:
    workspace = played(films, "squid", tmp_path)
    project = workspace.editor.project
    assert list(project.shapes) == ["mantle"] and len(project.layer_names) == 6
    squid = project.shapes["mantle"]
    assert closed(squid.mesh.faces)
    tips = [j for j in range(1, len(squid.skeleton)) if not squid.skeleton.children[j]]
    _, joints = Player(project, "mantle").sample(np.linspace(0, 2, 9))
    moved = np.ptp(joints[:, tips], axis=0).max(1)
    assert (moved > 0.1).sum() == 6 and (moved < 1e-9).sum() == 1, "the mantle's own tip stays"


@pytest.mark.slow
def test_the_mantis_stands_on_four_legs_and_reaches_with_two_arms(films, tmp_path) -> None:
    workspace = played(films, "mantis", tmp_path)
    project = workspace.editor.project
    assert list(project.shapes) == ["mantis"]
    takes = sorted(layer.take for layer in project.shapes["mantis"].layers)
    assert takes.count("reach") == 2 and takes.count("walk") >= 4
    mantis = project.shapes["mantis"]
    leaves = [j for j in range(1, len(mantis.skeleton)) if not mantis.skeleton.children[j]]
    assert len(leaves) == 7 and closed(mantis.mesh.faces)


shares = st.floats(0.05, 0.95)
pixels = st.builds(Pixel, shares, shares)
actions: st.SearchStrategy[Action] = st.one_of(
    st.builds(Key, st.sampled_from(["q", "g", "r", "i", "x", "c", "ctrl+d", "ctrl+v", "ctrl+c", "delete"])),
    st.builds(Key, st.sampled_from(["ctrl+m", "ctrl+equal", "ctrl+left", "ctrl+up", "ctrl+z", "space", "1"])),
    st.builds(Click, pixels, st.booleans()),
    st.builds(lambda a, b: Drag((a, b), 0.3), pixels, pixels),
    st.builds(lambda t: Do(lambda workspace: workspace.editor.scrub(t)), st.floats(0, 3)),
)


@given(st.lists(actions, min_size=5, max_size=25))
@settings(max_examples=15, deadline=None)
def test_undo_after_whatever_an_artist_does_gives_back_the_document(make_scene, todo) -> None:
    workspace = make_scene()
    first = workspace.editor.project
    play(todo, HeadlessStage(workspace))
    assert not any("enliven has an internal error" in toast.text for toast in workspace.editor.toasts.shown)
    for _ in workspace.editor.history.names:
        workspace.editor.undo()
    assert are_identical(workspace.editor.project, first)


@pytest.fixture(scope="module")
def make_scene(tmp_path_factory):
    """Returns two limbs in the centre of the image, one of them moving."""
    from enliven.motion.layers.retarget import bind_chain

    folder = tmp_path_factory.mktemp("recovery")

    def make() -> Workspace:
        workspace = Workspace.new(Editor(), folder)
        project = workspace.editor.project.with_characters(limb_at("limb", 0.0), limb_at("arm", 0.5))
        workspace.store.new(
            bind_chain(project, "limb", (0, 1, 2, 3), "wave", (0, 1, 2, 3, 4, 5, 6), loop=True)
        )
        return workspace

    return make


def limb_at(name: str, x: float):
    """Returns a limb of bones only, so that a random stroke is fast."""
    from enliven.document.rigged import still_shape
    from enliven.document.skeleton import Skeleton

    joints = np.stack([np.full(4, x), np.linspace(0.2, 1.4, 4), np.zeros(4)], 1)
    skeleton = Skeleton(tuple(f"{name} {k}" for k in range(4)), np.arange(-1, 3, dtype=np.int32), joints)
    return still_shape(name, skeleton)
