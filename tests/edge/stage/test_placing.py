"""Tests of placing performer and mesh (inside, side by side, limb by limb), and of their sizes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sample_meshes.chair import make_chair

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.errors import InputError
from enliven.meshes.mesh import Mesh
from enliven.person.body import Body
from enliven.person.joints import PARENTS, Joint
from enliven.possession import ActorSettings, EmbeddedActor
from enliven.possession.attachment.limb_retargeting import LimbRetargeting
from enliven.possession.likeness.finding import find_body_in_mesh
from enliven.possession.placement import rotation_about_y
from enliven_edge.stage.character_setup import create_actor
from enliven_edge.stage.stage import Stage
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.joint_limits import standing_pose
from enliven_edge.tracking.body_model.posture import Posture, rotation

FRAME = 33_333_333


def person(x=0.0, z=-2.5, yaw=0.0, id=1, lift=0.0, height=1.75, reach=0.0) -> Body:
    """Returns a standing person with the left thigh lifted and the right arm raised, both in radians."""
    rotations = standing_pose(yaw, arm_forward=0.1, elbow=0.1)
    rotations[model.THIGH_L] = rotation(x=-lift) @ rotations[model.THIGH_L]
    rotations[model.SHIN_L] = rotation(x=lift)
    rotations[model.UPPER_ARM_R] = rotation(x=-reach) @ rotations[model.UPPER_ARM_R]
    posture = Posture(np.array([x, height * 4 / 7, z]), rotations, model.lengths_for_height(height))
    return Body(id, posture.joints(), np.ones(20), stature=height)


def leaning(angle: float) -> Body:
    """Returns a person that bends forward at the hips by ``angle`` radians."""
    body = person()
    hip = body.joints[Joint.HIP_CENTER]
    up = list(range(1, 12))
    body.joints[up] = hip + (body.joints[up] - hip) @ rotation(x=angle).T
    return body


@pytest.fixture(scope="module")
def chair():
    mesh = make_chair(0.04)
    graph = DeformationGraph.build(mesh, nodes=64, seed=0)
    return character_from_graph(mesh, graph, "chair"), graph


def block(low, high, n=6) -> tuple[np.ndarray, np.ndarray]:
    """Returns (V, 3) vertices and (F, 3) faces of a box with n x n squares per side."""
    grid = np.linspace(0, 1, n + 1)
    vertices, faces = [], []
    for axis in range(3):
        for side in (0, 1):
            u, v = np.meshgrid(grid, grid, indexing="ij")
            square = np.empty(((n + 1) ** 2, 3))
            square[:, axis], square[:, (axis + 1) % 3], square[:, (axis + 2) % 3] = side, u.ravel(), v.ravel()
            i = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
            a, b, c, d = (k.ravel() for k in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
            quads = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
            faces.append((quads if side else quads[:, ::-1]) + len(vertices) * (n + 1) ** 2)
            vertices.append(square)
    return np.concatenate(vertices) * (np.array(high) - low) + low, np.concatenate(faces)


def beast() -> Mesh:
    """Returns an animal of overlapping blocks: a trunk along +X on four legs, with a head on a neck."""
    boxes = [((-0.7, 0.7, -0.2), (0.7, 1.1, 0.2)), ((0.55, 1.0, -0.12), (0.8, 1.5, 0.12))]
    boxes += [((0.7, 1.35, -0.12), (1.1, 1.55, 0.12))]
    boxes += [((x, 0.0, z), (x + 0.15, 0.8, z + 0.13)) for x in (-0.7, 0.55) for z in (-0.2, 0.07)]
    parts = [block(*box) for box in boxes]
    starts = np.cumsum([0, *(len(v) for v, _ in parts)])
    vertices = np.concatenate([v for v, _ in parts])
    return Mesh(vertices, np.concatenate([f + s for (_, f), s in zip(parts, starts, strict=False)]), "beast")


@pytest.fixture(scope="module")
def animal():
    mesh = beast()
    graph = DeformationGraph.build(mesh, nodes=96, seed=0)
    return character_from_graph(mesh, graph, "beast"), graph


def test_a_beast_is_like_a_person_on_all_fours(animal):
    like = find_body_in_mesh(beast(), animal[1])
    joints = like.joints
    assert like.yaw == pytest.approx(np.pi / 2, abs=0.2), "its front is where the head is"
    fore, hind = (joints[[j, j + 4]] for j in (Joint.HAND_LEFT, Joint.FOOT_LEFT))
    assert (fore[:, 0] > 0.5).all() and (hind[:, 0] < -0.5).all()
    assert fore[:, 1].max() < 0.25 and hind[:, 1].max() < 0.25
    assert fore[0, 2] < 0 < fore[1, 2] and hind[0, 2] < 0 < hind[1, 2], "its left is at -Z"
    assert joints[Joint.HEAD, 0] > 0.6 and joints[Joint.HEAD, 1] > 1.2


def play(stage, name, bodies):
    """Returns the last pose for a sequence of bodies. The first body is attached."""
    stage.perform([bodies[0]], 0)
    stage.possess(name)
    for i, body in enumerate(bodies, 1):
        pose = stage.perform([body], i * FRAME)[0]
    return pose


@pytest.mark.slow
def test_mapped_arms_drive_the_forelegs_and_legs_the_hind_legs(animal):
    rest = animal[0].pivots
    foot = rest[:, 1] < 0.3
    legs = {(s, e): foot & (rest[:, 0] * e > 0) & (rest[:, 2] * s > 0) for s in (-1, 1) for e in (-1, 1)}

    def moved(**last):
        stage = Stage([EmbeddedActor(*animal, ActorSettings(how="mapped", fade=0.0))])
        bodies = [person(**{k: v * i / 25 for k, v in last.items()}) for i in range(26)]
        pose = play(stage, "beast", bodies)
        still = Stage([EmbeddedActor(*animal, ActorSettings(how="mapped", fade=0.0))]).perform([person()], 0)[
            0
        ]
        return {
            leg: np.linalg.norm((pose.positions - still.positions)[at], axis=1).mean()
            for leg, at in legs.items()
        }

    arm, leg = moved(reach=0.7), moved(lift=0.7)
    assert arm[1, 1] > 0.2 and max(v for k, v in arm.items() if k != (1, 1)) < 0.6 * arm[1, 1]
    assert leg[-1, -1] > 0.15 and max(v for k, v in leg.items() if k != (-1, -1)) < 0.6 * leg[-1, -1]


@pytest.mark.parametrize("how", ["beside", "mapped"])
def test_mesh_next_to_its_performer_stays_at_attachment(chair, how):
    stage = Stage([EmbeddedActor(*chair, ActorSettings(how=how, aside=1.5, fade=0.0))])
    before = stage.perform([person()], 0)[0]
    assert before.positions[:, 0].mean() == pytest.approx(1.5, abs=0.1)
    stage.perform([person(x=-0.5)], FRAME)
    stage.possess("chair")
    held = stage.perform([person(x=-0.5)], 2 * FRAME)[0]
    assert np.linalg.norm(held.positions - before.positions, axis=1).max() < 0.02
    for i in range(30):
        lifted = stage.perform([person(x=-0.5, lift=0.03 * i)], (i + 3) * FRAME)[0]
    assert np.linalg.norm(lifted.positions - held.positions, axis=1).max() > 0.15


@pytest.mark.slow
@given(
    st.floats(-1, 1),
    st.floats(-1.2, 1.2),
    st.sampled_from(["beside", "mapped"]),
    st.sampled_from([0.0, 0.5, 1.0]),
)
@settings(max_examples=8, deadline=None)
def test_rigid_motion_is_transferred_to_the_mesh_next_to_it(chair, way, yaw, how, travel):
    """The performer's rigid rotation rotates the mesh equally; walking moves it by the set fraction of the
    way."""
    stage = Stage([EmbeddedActor(*chair, ActorSettings(how=how, travel=travel, fade=0.0))])
    start = stage.perform([person()], 0)[0]
    stage.possess("chair")
    for i in range(1, 45):
        part = min(i / 25, 1)
        pose = stage.perform([person(x=way * part, yaw=yaw * part)], i * FRAME)[0]
    turn = rotation_about_y(yaw)
    turned = start.positions @ turn.T
    shift = (pose.positions - turned).mean(0)
    assert np.linalg.norm(pose.positions - turned - shift, axis=1).max() < 0.03
    if how == "beside":
        # The mesh turns about the performer's hip, mapped into the mesh.
        pivot = np.array([1.2, 0.0, -2.5])
        expected = pivot - turn @ pivot + [travel * way, 0, 0]
        np.testing.assert_allclose(shift[[0, 2]], expected[[0, 2]], atol=0.05)


@pytest.mark.slow
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_mapped_bones_keep_their_lengths_and_begin_at_rest(animal, seed):
    rng = np.random.default_rng(seed)
    like, body = find_body_in_mesh(beast(), animal[1]), person(yaw=rng.uniform(-3, 3))
    carrying = LimbRetargeting(like, body, 1.0)
    np.testing.assert_allclose(carrying(body.joints), like.joints, atol=1e-9)
    anything = rng.normal(size=(20, 3))
    anything[rng.integers(0, 20, 4)] = np.nan
    out = carrying(anything)
    for joint in range(1, 20):
        parent = PARENTS[joint]
        before = np.linalg.norm(like.joints[joint] - like.joints[parent])
        assert np.linalg.norm(out[joint] - out[parent]) == pytest.approx(before, abs=1e-9)


def saved(path: Path, height: float) -> str:
    """Saves the chair as a file with the given height."""
    mesh = make_chair(0.08)
    factor = height / np.ptp(mesh.vertices[:, 1])
    lines = ["v {:.7g} {:.7g} {:.7g}".format(*v) for v in mesh.vertices * factor]
    lines += ["f {} {} {}".format(*(f + 1)) for f in mesh.faces]
    path.write_text("\n".join(lines))
    return str(path)


SIZES = {"smaller than a hand": 0.08, "chair": 0.9, "tall as a tower": 100.0}


@pytest.mark.slow
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scaled", ["mesh", "performer"])
@pytest.mark.parametrize("how", ["inside", "beside"])
def test_any_size_is_possessed_alike(tmp_path, size, scaled, how):
    """The mesh is scaled to the performer, or keeps its size and the motion is scaled."""
    own = ActorSettings(scaled=scaled, how=how, fade=0.0)
    stage = Stage([create_actor(saved(tmp_path / "m.obj", SIZES[size]), 32, own)])
    stage.perform([person()], 0)
    stage.possess("m")
    still = stage.perform([person()], FRAME)[0]
    tall = 1.75 if scaled == "mesh" else SIZES[size]
    assert np.ptp(still.positions[:, 1]) == pytest.approx(tall, rel=0.15)
    for i in range(30):
        pose = stage.perform([leaning(0.02 * i)], (i + 2) * FRAME)[0]
    farthest = np.linalg.norm(pose.positions - still.positions, axis=1).max()
    assert 0.1 * tall < farthest < 0.7 * tall
    assert len(stage.cues()["m"].nodes) >= 4


@pytest.mark.slow
def test_metre_for_metre_a_tower_is_out_of_reach_and_a_toy_hangs_on_a_limb(tmp_path):
    own = ActorSettings(scaled="nobody", fade=0.0)
    tower = Stage([create_actor(saved(tmp_path / "tower.obj", 100.0), 32, own)])
    tower.perform([person()], 0)
    with pytest.raises(InputError, match="no part of the mesh is within"):
        tower.possess("tower")
    toy = Stage([create_actor(saved(tmp_path / "toy.obj", 0.08), 32, own)])
    toy.perform([person()], 0)
    toy.possess("toy")
    still = toy.perform([person()], FRAME)[0]
    assert np.ptp(still.positions[:, 1]) == pytest.approx(0.08, rel=0.15)
    for i in range(20):
        pose = toy.perform([person(x=0.02 * i)], (i + 2) * FRAME)[0]
    assert (pose.positions - still.positions)[:, 0].mean() == pytest.approx(0.38, abs=0.03)


@pytest.mark.parametrize("height", [1.1, 1.75, 2.0])
def test_the_mesh_is_as_tall_as_its_performer_or_so_much_taller(chair, height):
    for ratio in (1.0, 0.6):
        stage = Stage([EmbeddedActor(*chair, ActorSettings(height_ratio=ratio))])
        pose = stage.perform([person(height=height)], 0)[0]
        assert pose.linear[0, 1, 1] * np.ptp(chair[0].vertices[:, 1]) == pytest.approx(
            ratio * height, rel=1e-3
        )


def moved_chair(chair, x: float, z: float):
    """Returns the chair at another position in its project, as character and graph."""
    character, graph = chair
    mesh = Mesh(character.vertices + np.array([x, 0.0, z]), character.faces, "chair")
    graph = DeformationGraph.build(mesh, nodes=64, seed=0)
    return character_from_graph(mesh, graph, "chair"), graph


@pytest.mark.parametrize("how", ["inside", "beside"])
@pytest.mark.parametrize("place", [(2.0, 0.0), (0.0, -3.0), (-1.3, 1.3), (0.98, 0.0)])
def test_a_mesh_that_lies_elsewhere_in_its_project_is_possessed_where_the_performer_is(chair, place, how):
    stage = Stage([EmbeddedActor(*moved_chair(chair, *place), ActorSettings(how=how, fade=0.0))])
    waiting = stage.perform([person()], 0)[0]
    hip = person().joints[Joint.HIP_CENTER, [0, 2]]
    aside = np.linalg.norm(waiting.positions[:, [0, 2]].mean(0) - hip)
    assert aside == pytest.approx(1.2 if how == "beside" else 0.0, abs=0.35)
    stage.possess("chair")
    still = stage.perform([person()], FRAME)[0]
    assert np.linalg.norm(still.positions - waiting.positions, axis=1).max() < 0.05, "it jumped"
    for i in range(30):
        pose = stage.perform([leaning(0.02 * i)], (i + 2) * FRAME)[0]
    assert np.linalg.norm(pose.positions - still.positions, axis=1).max() > 0.15


def test_a_mesh_that_lies_elsewhere_grows_about_where_it_stands(chair):
    actor = EmbeddedActor(*moved_chair(chair, 2.0, 0.0), ActorSettings(fade=0.0))
    stage = Stage([actor])
    middle = stage.perform([person()], 0)[0].positions[:, [0, 2]].mean(0)
    actor.resize(2.0)
    larger = stage.perform([person()], FRAME)[0]
    np.testing.assert_allclose(larger.positions[:, [0, 2]].mean(0), middle, atol=0.1)
    stage.possess("chair")
    held = stage.perform([person()], 2 * FRAME)[0]
    np.testing.assert_allclose(held.positions, larger.positions, atol=0.05)


def test_the_origin_of_a_mesh_about_it_stays_the_place_to_stand(chair):
    middles = [
        Stage([EmbeddedActor(*parts, ActorSettings())]).perform([person()], 0)[0].positions.mean(0)
        for parts in (moved_chair(chair, 0.0, 0.0), moved_chair(chair, 0.2, 0.0))
    ]
    assert abs(middles[1] - middles[0])[0] == pytest.approx(0.2, abs=0.03), "as it is modelled"


def test_an_animal_that_lies_elsewhere_is_driven_limb_by_limb_where_it_waits(animal):
    character, _ = animal
    mesh = Mesh(character.vertices + np.array([4.0, 0.0, 1.0]), character.faces, "beast")
    graph = DeformationGraph.build(mesh, nodes=96, seed=0)
    parts = character_from_graph(mesh, graph, "beast"), graph
    stage = Stage([EmbeddedActor(*parts, ActorSettings(how="mapped", fade=0.0))])
    waiting = stage.perform([person()], 0)[0]
    hip = person().joints[Joint.HIP_CENTER, [0, 2]]
    assert np.linalg.norm(waiting.positions[:, [0, 2]].mean(0) - hip) == pytest.approx(1.2, abs=0.5)
    stage.possess("beast")
    pose = stage.perform([person(reach=0.7)], FRAME)[0]
    moved = np.linalg.norm(pose.positions - waiting.positions, axis=1)
    assert 0.1 < moved.max() < 1.5


def test_unreachable_part_is_refused_with_advice(tmp_path):
    own = ActorSettings(scaled="nobody", fade=0.0)
    low = Stage([create_actor(saved(tmp_path / "low.obj", 0.15), 32, own)])
    low.perform([person()], 0)
    with pytest.raises(InputError, match="Attach with the whole body"):
        low.possess("low", None, "head")
