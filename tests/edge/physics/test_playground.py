"""Tests of the playground: its placement, pushing bodies, game messages, and repeatability."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from enliven.document.character import Character, Pose, SkinWeights
from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.person import BONES, Joint
from enliven.samples.shipped import load_sample
from enliven.settings import load_settings

from .conftest import FRAME, UNBOUND, person

pytest.importorskip("mujoco", reason="the physics engine is an extra: pip install ./edge[physics]")

from enliven_edge.physics.games import find_clear_places, tower_places, tower_props
from enliven_edge.physics.ground import WorldGround, body_spheres, ground_under
from enliven_edge.physics.playground import Playground
from enliven_edge.physics.settings import BoxesSettings, DodgeballSettings, PhysicsSettings
from enliven_edge.stage.tick import Tick

NS = round(1e9 * FRAME)
SMALL = BoxesSettings(at=((0.5, 0.0),), wide=1, high=3, rebuild=1.0)


def block(name: str = "block") -> Character:
    """Returns a block of 0.3 m that follows one node."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (0, 2) for z in (-1, 1)], np.float32) * 0.15
    squares = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = np.array([f for a, b, c, d in squares for f in ((a, b, c), (a, c, d))], np.int32)
    weights = np.zeros((8, 4), np.float32)
    weights[:, 0] = 1
    skin = SkinWeights(np.zeros((8, 4), np.uint16), weights)
    return Character(name, corners, faces, skin, np.zeros((1, 3), np.float32), np.zeros((0, 2), np.int32))


def at(place: tuple[float, float, float], name: str = "block", scale: float = 1.0) -> Pose:
    return Pose(name, 0, scale * np.eye(3, dtype=np.float32)[None], np.array([place], np.float32))


def playground(world: str = "boxes", **changes) -> Playground:
    plain = {"engine": UNBOUND, "place": "fixed", "boxes": SMALL, "bodies": "never", **changes}
    return Playground(PhysicsSettings(world=world, **plain), [block()])


def step(made: Playground, poses, bodies, holders, time_ns: int):
    """Returns the props after a frame with these poses, bodies and holders."""
    frame = BodyFrame(bodies, time_ns, "given")
    return made.step(Tick(frame, bodies, poses, holders=frozenset(holders)))


def performed(made: Playground, path, frames: int = 60) -> list[np.ndarray]:
    """Returns the props' positions in every frame while a block moves along ``path``."""
    places = []
    for k in range(frames):
        props = step(made, [at(path(k))], [], set(), k * NS)
        assert props is not None
        places.append(props.positions)
    return places


def across(k: int) -> tuple[float, float, float]:
    return (min(-0.4 + 0.06 * k, 1.2), 0.0, 0.0)


def test_a_character_knocks_the_tower_over():
    simulation = playground()
    places = performed(simulation, across)
    assert np.abs(places[8] - places[0]).max() < 0.005
    # Two boxes are on the floor beyond the block; the third may be on the block.
    assert (places[-1][:, 0] > 0.7).all() and (places[-1][:, 1] < 0.1).sum() >= 2
    props = step(simulation, [at(across(60))], [], set(), 60 * NS)
    assert props.note == "3 of 3 boxes down"


def test_towers_are_not_built_into_a_character():
    simulation = playground()
    first = step(simulation, [at((0.55, 0.0, 0.1))], [], set(), 0).positions
    for k in range(1, 45):
        props = step(simulation, [at((0.55, 0.0, 0.1))], [], set(), k * NS)
    assert np.abs(props.positions - first).max() < 0.01 and props.note == ""
    assert 0.1 < np.linalg.norm(first[0, [0, 2]] - (0.5, 0.0)) < 0.6, "aside, and still at hand"


@pytest.mark.parametrize(("name", "tower"), [("chair", 0), ("lamp", 1)])
def test_no_tower_box_flies_before_attachment(name: str, tower: int) -> None:
    """A shipped mesh stands at the position of a default tower. Without the check, 43 of 48 boxes flew
    off.
    """
    mesh, boxes = load_sample(name), BoxesSettings()
    weights = np.tile(np.array([1, 0, 0, 0], np.float32), (len(mesh.vertices), 1))
    skin = SkinWeights(np.zeros((len(mesh.vertices), 4), np.uint16), weights)
    corners, middle = mesh.vertices.astype(np.float32), np.zeros((1, 3), np.float32)
    still = Character(name, corners, mesh.faces, skin, middle, np.zeros((0, 2), np.int32))
    simulation = Playground(PhysicsSettings("boxes", boxes=boxes, engine=UNBOUND, place="fixed"), [still])
    place = boxes.at[tower][0], 0.0, boxes.at[tower][1]
    first = step(simulation, [at(place, name)], [], set(), 0).positions
    for k in range(1, 30):
        props = step(simulation, [at(place, name)], [], set(), k * NS)
    assert len(first) == 48 and np.linalg.norm(props.positions - first, axis=1).max() < 0.02


@given(st.integers(0, 10**6), st.integers(0, 60), st.integers(1, 3))
def test_tower_moves_only_if_its_place_is_occupied(seed, count, wide):
    rng = np.random.default_rng(seed)
    settings = BoxesSettings(wide=wide)
    spheres, radii = rng.uniform((-1.2, 0, -1.2), (1.2, 2, 1.2), (count, 3)), rng.uniform(0.01, 0.2, count)
    meant, boxes = (each.reshape(2, -1, 3) for each in (
        tower_places(settings), find_clear_places(settings, spheres, radii)
    ))  # fmt: skip
    half = settings.side / 2
    for tower, wanted in zip(boxes, meant, strict=True):
        gap = np.maximum(np.abs(tower[:, None] - spheres) - half, 0.0)
        assert not count or (np.linalg.norm(gap, axis=2) > radii).all()
        np.testing.assert_allclose(np.ptp(tower - wanted, axis=0), 0.0, atol=1e-12)  # moved as one rigid body
        if (
            not count
            or np.abs(spheres - wanted.mean(0))[:, [0, 2]].max(1).min() > 0.2 + 0.15 + 2 * wide * half
        ):
            np.testing.assert_allclose(tower, wanted)
    assert np.abs(boxes[0].mean(0) - boxes[1].mean(0)).max() > 2 * wide * half


def test_world_is_built_for_a_performer_that_never_stands_still():
    simulation = playground(place="performer", patience=2.0)
    for k in range(100):
        swing = 0.4 * np.sin(0.3 * k)
        props = step(simulation, [], [person((1.0 + swing, -3.0))], set(), k * NS)
        if props is not None:
            break
    assert k in (60, 61) and np.allclose(props.positions[:, [0, 2]].mean(0), [1.5, -3.0], atol=0.1)


def test_the_same_frames_give_the_same_props():
    first, second = (performed(playground(), across, 40) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_boxes_appear_only_after_a_person_stands_still():
    simulation = playground(place="performer")
    assert step(simulation, [at((9, 0, 9))], [], set(), 0) is None
    for k in range(1, 20):
        assert step(simulation, [], [person((0.05 * k, -3.0))], set(), k * NS) is None, "they still walk"
    for k in range(20, 28):
        assert step(simulation, [], [person((2.0, -3.0))], set(), k * NS) is None
    props = step(simulation, [], [person((2.02, -3.0))], set(), 32 * NS)
    assert np.allclose(props.positions[:, [0, 2]].mean(0), [2.52, -3.0], atol=0.05)
    later = step(simulation, [], [person((-1.0, -1.0))], set(), 33 * NS)
    assert np.allclose(later.positions, props.positions, atol=0.01), "the place is known once and for all"


@pytest.mark.parametrize(("rule", "holders", "pushes"), [
    ("never", set(), False), ("free", set(), True), ("free", {1}, False), ("always", {1}, True),
])  # fmt: skip
def test_performers_push_only_if_the_rule_allows(rule, holders, pushes):
    simulation = playground(bodies=rule)
    for k in range(45):
        body = person((-0.4 + 0.03 * k, 0.0))
        props = step(simulation, [], [body], holders, k * NS)
    assert (np.abs(props.positions[:, 0] - 0.5).max() > 0.2) == pushes


def test_character_appearing_among_boxes_does_not_fling_them():
    simulation = playground()
    step(simulation, [], [], set(), 0)
    highest = 0.0
    for k in range(1, 40):
        step(simulation, [at((0.5, 0.1, 0.05))], [], set(), k * NS)
        highest = max(highest, float(np.abs(simulation.world.velocities[:, :3]).max()))
    assert highest < 4.0 and simulation.resets == 0


def test_boxes_stay_while_characters_scale_leave_and_return():
    simulation = playground()
    simulation.introduce(block("second"))
    poses = [
        [], [at((0, 0, 3))], [at((0, 0, 3), scale=2.0)], [at((0, 0, 3)), at((1, 0, 3), "second")],
        [at((1, 0, 3), "second")], [at((0, 0, 3), "unknown")], [at((np.nan, 0, 3))],
    ]  # fmt: skip
    for k, poses_now in enumerate(poses * 3):
        props = step(simulation, poses_now, [person((0, 5), 1)] * (k % 2), set(), k * NS)
        assert np.abs(props.positions[:, 0] - 0.5).max() < 0.02
    assert simulation.resets == 0


def test_fallen_towers_stand_again_but_not_on_anybody():
    simulation = playground()
    places = performed(simulation, across, 60)
    for k in range(60, 200):
        props = step(simulation, [at((0.5, 0.0, 0.0))], [], set(), k * NS)
    assert props.note, "somebody stands where the tower was"
    for k in range(200, 320):
        props = step(simulation, [at((5.0, 0.0, 0.0))], [], set(), k * NS)
    assert np.allclose(props.positions, places[0], atol=0.01) and props.note == ""


def test_a_replay_that_begins_again_begins_with_new_towers():
    simulation = playground()
    places = performed(simulation, across, 60)
    restarted = step(simulation, [at(across(0))], [], set(), 0)
    assert np.allclose(restarted.positions, places[0], atol=1e-6)


def test_playground_with_nan_velocity_restarts(caplog):
    simulation = playground()
    performed(simulation, lambda k: (-2.0, 0.0, 0.0), 3)
    simulation.world.velocities[0, 0] = np.nan
    props = step(simulation, [], [], set(), 3 * NS)
    assert simulation.resets == 1 and "was restarted" in caplog.text
    assert np.allclose(props.positions, tower_places(SMALL), atol=1e-6)


def test_balls_are_thrown_and_hits_are_counted():
    game = DodgeballSettings(balls=2, every=0.5, flight=0.4, distance=1.5)
    simulation = playground("dodgeball", dodgeball=game, bodies="free")
    for k in range(150):
        body = person((0.0, -3.0), 7)
        props = step(simulation, [at((0.0, 0.0, 0.0))], [body], set(), k * NS)
    assert simulation.game.hits["block"] >= 1 and simulation.game.hits["performer 7"] >= 1
    assert "block hit" in props.note and "performer 7 hit" in props.note


def test_character_stepping_aside_is_not_hit():
    game = DodgeballSettings(balls=1, every=0.5, flight=0.8, distance=2.5)
    simulation = playground("dodgeball", dodgeball=game)
    for k in range(120):
        aside = 1.5 * (k // 20 % 2)
        step(simulation, [at((aside, 0.0, 0.0))], [], set(), k * NS)
    always = playground("dodgeball", dodgeball=game)
    performed(always, lambda k: (0.0, 0.0, 0.0), 120)
    assert simulation.game.hits["block"] < always.game.hits["block"]


def test_bodies_become_spheres_about_their_joints():
    centres, radii = body_spheres(person())
    assert centres.shape == (len(Joint) + 2 * len(BONES), 3) and (radii > 0.03).all() and (radii < 0.15).all()
    broken = person()
    broken.joints[3] = np.nan
    assert np.isnan(body_spheres(broken)[0]).any(1).sum() == 3  # the head, and two along the neck


def test_the_ground_is_where_a_performer_stands_and_looks():
    ground = WorldGround(np.array([1.0, 0.0, 2.0]), np.pi / 2)
    # A person rotated by 90 degrees from +Z faces +X, and has -Z to the left.
    np.testing.assert_allclose(
        ground.to_world(np.array([[0, 0, 1.0], [1, 0, 0]])), [[2, 0, 2], [1, 0, 1]], atol=1e-12
    )
    standpoint = ground_under(person((3.0, 4.0)))
    assert (
        standpoint is not None
        and np.allclose(standpoint.at[[0, 2]], [3, 4], atol=0.05)
        and abs(standpoint.yaw) < 0.1
    )
    unseen = replace(person(), confidence=np.zeros(20))
    assert ground_under(unseen) is None


def test_towers_stand_on_the_floor_and_touch_nothing():
    settings = BoxesSettings()
    places, props = tower_places(settings), tower_props(settings)
    assert len(places) == len(props.shapes) == 48
    assert places[:, 1].min() == pytest.approx(settings.side / 2)
    apart = np.abs(places[:, None] - places[None]).max(2) + 10 * np.eye(48)
    assert apart.min() >= settings.side - 1e-9


def test_too_many_boxes_are_refused_and_none_are_a_world_too():
    with pytest.raises(InputError, match="432 boxes"):
        tower_props(BoxesSettings(at=((0, 0),) * 2, wide=6, high=6))
    bare = playground(boxes=BoxesSettings(at=()))
    props = step(bare, [at((0, 0, 0))], [], set(), 0)
    assert len(step(bare, [at((0.1, 0, 0))], [], set(), NS)) == 0 == len(props) and props.note == ""


def test_settings_are_read_and_checked():
    read = load_settings(PhysicsSettings, {"world": "boxes", "boxes": {"at": [[1, 2]], "high": 3}})
    assert read.boxes.at == ((1.0, 2.0),) and read.boxes.high == 3
    with pytest.raises(InputError, match=r"'none' or 'boxes' or 'dodgeball'"):
        load_settings(PhysicsSettings, {"world": "bowling"})
    with pytest.raises(InputError, match="Set world to boxes"):
        Playground(PhysicsSettings(world="none"))


def test_every_character_on_the_stage_pushes_and_one_that_has_gone_does_not() -> None:
    simulation = playground()
    pair = {name: block(name) for name in ("block", "other")}
    simulation.show(pair)
    poses = [at((5.0, 0.0, 0.0)), at((-5.0, 0.0, 0.0), "other")]
    step(simulation, poses, [], set(), 0)
    assert set(simulation._slots) == set(pair)
    before = simulation._proxies["block"]
    simulation.show({"block": pair["block"]})
    step(simulation, poses, [], set(), NS)
    assert set(simulation._slots) == {"block"} and simulation._proxies["block"] is before
    simulation.show({"block": block()})
    assert simulation._proxies["block"] is not before
