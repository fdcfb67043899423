"""Tests of puppets in the viewer: solved in the background, rigid until then, and moved with their frame."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from patience import wait_until
from sample_meshes.chair import make_chair
from tolerances import SOLVER_TOLERANCE, assert_alike

from enliven.arrays import Float
from enliven.deformation.arap.control_point_surface import PuppetSurface
from enliven.document.character import Character, Pose
from enliven.document.puppet import ControlPoint, ExampleCharacter, character_from_puppet
from enliven.document.surface_settings import ArapSettings
from enliven.meshes.mesh import Mesh, refine
from enliven.rotation import from_rotation_vector, to_matrix
from enliven_viewer.playback.document import Document
from enliven_viewer.playback.solved_surfaces import SolvedSurfaces
from enliven_viewer.playback.timeline import Timeline
from enliven_viewer.render.overlay.marks import make_node_rows
from enliven_viewer.render.scene import SceneCharacter, SceneStyle, make_scene

CHAIR = refine(make_chair(), 0.08)
TOP = int(CHAIR.vertices[:, 1].argmax())
FEET = tuple(int(v) for v in np.argsort(CHAIR.vertices[:, 1])[[0, 40, 80]])
HELD = (TOP, *FEET)


def puppet(mesh: Mesh = CHAIR, settings: ArapSettings | None = None) -> ExampleCharacter:
    points = tuple(ControlPoint(str(k), v) for k, v in enumerate(HELD))
    return ExampleCharacter("chair", mesh, points, surface=settings or ArapSettings())


CHARACTER = character_from_puppet(puppet())


def pose(places: Float, turn: float = 0.0, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Pose:
    """Returns a pose with the chair's control points at (P, 3) positions in its own frame, which is moved and
    rotated.
    """
    frame = to_matrix(from_rotation_vector(np.array([0.0, turn, 0.0])))
    with np.errstate(invalid="ignore"):  # impossible positions are tested as well
        positions = np.concatenate([np.zeros((1, 3)), places]) @ frame.T + at
    linear = np.tile(frame, (len(positions), 1, 1))
    return Pose("chair", 0, linear.astype(np.float32), positions.astype(np.float32))


def bent(by: float = 0.2) -> Float:
    places = CHAIR.vertices[list(HELD)].copy()
    places[0] += [by, 0.5 * by, 0.0]
    return places


def shown(surfaces: SolvedSurfaces, made: Pose, character: Character = CHARACTER) -> Float:
    """Returns the vertices once they are solved."""
    wait_until(lambda: surfaces.vertices(character, made) is not None, "the surface")
    vertices = surfaces.vertices(character, made)
    assert vertices is not None
    return vertices


def test_a_film_shows_what_the_solver_makes_of_each_pose() -> None:
    solver = PuppetSurface(Mesh(CHARACTER.vertices.astype(np.float64), CHAIR.faces), HELD)
    surfaces = SolvedSurfaces(wait=True)
    for k, by in enumerate((0.1, 0.2, 0.15, -0.1)):
        places = bent(by).astype(np.float32).astype(np.float64)
        own = solver.solve_from_rest(places) if k == 0 else solver.solve(places)
        seen = surfaces.vertices(CHARACTER, pose(bent(by)))
        np.testing.assert_allclose(seen, own, atol=1e-5)


def test_control_points_are_on_the_surface_wherever_the_puppet_stands() -> None:
    moved = pose(bent(), turn=2.0, at=(3.0, 0.1, -2.0))
    vertices = SolvedSurfaces(wait=True).vertices(CHARACTER, moved)
    assert vertices is not None
    np.testing.assert_allclose(vertices[list(HELD)], moved.positions[1:], atol=1e-4)


def test_a_puppet_that_is_carried_about_keeps_its_shape() -> None:
    surfaces = SolvedSurfaces(wait=True)
    first = surfaces.vertices(CHARACTER, pose(bent()))
    for _ in range(20):
        first = surfaces.vertices(CHARACTER, pose(bent()))
    moved = pose(bent(), turn=-1.2, at=(0.5, 0.0, 4.0))
    vertices = surfaces.vertices(CHARACTER, moved)
    assert first is not None
    np.testing.assert_allclose(vertices, first @ moved.linear[0].T + moved.positions[0], atol=2e-3)


def test_frames_do_not_wait_for_the_surface() -> None:
    surfaces = SolvedSurfaces()
    assert surfaces.vertices(CHARACTER, pose(bent())) is None
    seen = shown(surfaces, pose(bent()))
    np.testing.assert_allclose(seen[list(HELD)], bent(), atol=1e-4)


def test_a_still_puppet_is_solved_until_it_rests_and_then_no_more(monkeypatch) -> None:
    count = 0
    solve = PuppetSurface.solve

    def counted(self: PuppetSurface, places: Float) -> Float:
        nonlocal count
        count += 1
        return solve(self, places)

    monkeypatch.setattr(PuppetSurface, "solve", counted)
    surfaces = SolvedSurfaces(wait=True)
    for _ in range(60):
        surfaces.vertices(CHARACTER, pose(bent()))
    assert 3 < count < 30


@pytest.mark.parametrize("what", [np.nan, np.inf, 1e9])
def test_impossible_positions_keep_the_last_good_shape(what: float) -> None:
    surfaces = SolvedSurfaces(wait=True)
    before = surfaces.vertices(CHARACTER, pose(bent()))
    wild = bent()
    wild[0, 1] = what
    np.testing.assert_array_equal(surfaces.vertices(CHARACTER, pose(wild)), before)
    assert surfaces.vertices(CHARACTER, pose(bent(0.25))) is not None


def test_invalid_frame_is_drawn_rigidly() -> None:
    broken = pose(bent())
    broken.linear[0] = 0.0
    assert SolvedSurfaces(wait=True).vertices(CHARACTER, broken) is None


def test_undeformable_mesh_is_rigid_and_reported_once(caplog) -> None:
    loose = Mesh(np.vstack([CHAIR.vertices, [[0.0, 3.0, 0.0]]]), CHAIR.faces)
    points = (ControlPoint("nowhere", len(CHAIR.vertices)),)
    lost = character_from_puppet(ExampleCharacter("chair", loose, points))
    surfaces, moved = SolvedSurfaces(wait=True), pose(np.array([[0.0, 3.0, 0.0]]))
    for _ in range(3):
        assert surfaces.vertices(lost, moved) is None
    messages = [record.getMessage() for record in caplog.records]
    assert len(messages) == 1
    assert "is shown as a rigid mesh" in messages[0]
    assert "belongs to no face" in messages[0]


def test_the_solver_has_the_puppets_own_settings() -> None:
    plain = character_from_puppet(puppet(settings=ArapSettings(squash_and_stretch=False)))
    long = bent(0.0)
    long[0, 1] += 0.5
    solved = [SolvedSurfaces(wait=True).vertices(c, pose(long)) for c in (CHARACTER, plain)]
    assert solved[0] is not None
    assert solved[1] is not None
    assert np.abs(solved[0] - solved[1]).max() > 0.01


def test_soft_points_do_not_get_where_they_pull() -> None:
    pulls = np.array([0.05, 0, 0, 0], np.float32)
    moved = pose(bent())
    vertices = SolvedSurfaces(wait=True).vertices(replace(CHARACTER, pulls=pulls), moved)
    assert vertices is not None
    away = np.linalg.norm(vertices[list(HELD)] - moved.positions[1:], axis=1)
    assert away[0] > 0.02
    assert away[1:].max() < 1e-4


def test_another_revision_of_a_character_is_another_surface() -> None:
    surfaces = SolvedSurfaces(wait=True)
    surfaces.vertices(CHARACTER, pose(bent()))
    other = replace(CHARACTER, surface=ArapSettings(squash_and_stretch=False))
    seen, fresh = (s.vertices(other, pose(bent())) for s in (surfaces, SolvedSurfaces(wait=True)))
    assert_alike(seen, fresh, SOLVER_TOLERANCE)


def test_a_scene_has_the_solved_surface_and_lets_go_of_who_is_gone() -> None:
    document, surfaces = Document(Timeline(bounded=False)), SolvedSurfaces(wait=True)
    document.add_character(CHARACTER)
    document.add_pose(pose(bent()))
    scene = make_scene(document, document.timeline.find_moment(0), SceneStyle(), surfaces)
    solved = scene.actors[0].vertices
    assert solved is not None
    np.testing.assert_allclose(solved[TOP], bent()[0], atol=1e-4)
    assert make_scene(document, document.timeline.find_moment(0), SceneStyle()).actors[0].vertices is None
    document.remove_character("chair")
    make_scene(document, document.timeline.find_moment(0), SceneStyle(), surfaces)
    assert not surfaces._known


def test_only_control_points_are_marked() -> None:
    moved = pose(bent(), at=(1.0, 0.0, 0.0))
    rows = make_node_rows(SceneCharacter(CHARACTER, moved), 1.0)
    np.testing.assert_array_equal(rows[:, :3], moved.positions[1:])


def test_unchanged_scene_costs_nothing() -> None:
    surfaces = SolvedSurfaces(wait=True)
    shown_last = [surfaces.vertices(CHARACTER, pose(bent(), turn=0.4)) for _ in range(40)]
    assert shown_last[-1] is shown_last[-2]
    assert surfaces.vertices(CHARACTER, pose(bent(), turn=0.5)) is not shown_last[-1]


def test_viewer_without_puppets_loads_no_solver() -> None:
    """The solver is a third of everything that a viewer loads before its first frame."""
    heavy = {"enliven.deformation.arap.solver", "scipy.sparse.linalg"}
    look = (
        f"import sys, enliven_viewer.film, enliven_viewer.live.live_stage; print(*{heavy} & set(sys.modules))"
    )
    shown = subprocess.run(
        [sys.executable, "-c", look], capture_output=True, text=True, timeout=300, check=True
    )
    assert shown.stdout.split() == []


@pytest.mark.slow
def test_a_window_starts_without_what_its_first_tool_needs() -> None:
    """SciPy loads these modules when they are first used. They were a sixth of the start time."""
    later = {"scipy.spatial", "scipy.optimize", "scipy.ndimage"}
    look = f"""
import sys
from enliven_viewer.studio.window.window import StudioWindow
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.workspace.workspace import Workspace
print(StudioWindow is not None, *{later} & set(sys.modules))
"""
    shown = subprocess.run(
        [sys.executable, "-c", look], capture_output=True, text=True, timeout=300, check=True
    )
    assert shown.stdout.split() == ["True"]
