"""Tests of the physics engine's world: resting props stay, hit props move away, and nothing explodes."""

from __future__ import annotations

import importlib.util
import sys

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from enliven.document import BALL
from enliven.errors import ResourceError

from .conftest import FRAME, UNBOUND, balls, boxes, pushed

if importlib.util.find_spec("mujoco") is None:
    pytest.skip("the physics engine is an extra: pip install ./edge[physics]", allow_module_level=True)

from enliven.doctor import need
from enliven_edge.physics.contacts import FLOOR, NOTHING, correct_contacts, limit_speeds
from enliven_edge.physics.world import MAX_PROP_SPEED_M_S, World

LONGEST_ROCKING = 60
"""Maximum seconds until two dropped boxes are at rest. The maximum of 2,700 random tries was 17 s."""


def energy_of(world: World) -> float:
    """Returns the kinetic plus potential energy of all props in joules."""
    mass, (x, y, z) = world.props.masses, world.props.sizes.T
    ball = world.props.shapes == BALL
    boxes = np.stack([y * y + z * z, x * x + z * z, x * x + y * y], 1) / 3
    inertia = mass[:, None] * np.where(ball[:, None], 0.4 * (x * x)[:, None], boxes)
    moving = mass * np.square(world.velocities[:, :3]).sum(1)
    turning = (inertia * np.square(world.velocities[:, 3:])).sum(1)
    return float((0.5 * (moving + turning) + world.settings.gravity * mass * world.positions[:, 1]).sum())


def tower(high: int = 5) -> World:
    world = World(boxes(high), UNBOUND)
    world.set_state(slice(None), np.array([[0, 0.1 + 0.2 * k, 0] for k in range(high)]))
    return world


def run(world: World, seconds: float) -> None:
    for _ in range(round(seconds / FRAME)):
        assert world.advance(FRAME) == ""


def test_a_tower_stands_still():
    world = tower()
    begin, energy = world.positions.copy(), energy_of(world)
    run(world, 2.0)
    rested = world.positions.copy()
    run(world, 3.0)
    assert np.abs(rested - begin).max() < 0.004, "it sank into itself"
    assert np.abs(world.positions - rested).max() < 1e-5, "it creeps"
    assert np.abs(world.velocities).max() < 1e-4, "it trembles"
    assert energy_of(world) <= energy + 1e-9
    assert world.touched[0] == FLOOR and (world.touched[1:] == NOTHING).all()


@given(height=st.floats(0.3, 2.0), turn=st.integers(0, 99))
@settings(max_examples=10, deadline=None)
@example(1.1, 0)  # the upper box balances on the lower one's edge, slips for 12 s, and falls
def test_no_energy_comes_from_nowhere(height, turn):
    """Two boxes that fall on each other lose energy and come to rest, however long they rock and slide."""
    world = World(boxes(2), UNBOUND)
    spin = np.random.default_rng(turn).normal(size=(2, 4))
    world.set_state(
        slice(None),
        np.array([[0, height, 0], [0.05, height + 0.4, 0]]),
        spin / np.linalg.norm(spin, axis=1, keepdims=True),
    )
    start = before = energy_of(world)
    for _ in range(LONGEST_ROCKING):
        for _ in range(round(1 / FRAME)):
            assert world.advance(FRAME) == ""
            # An elastic contact returns energy: it rises for a moment, but not above the initial energy.
            assert energy_of(world) <= start + 1e-3
        if abs(energy_of(world) - before) < 1e-4:
            break
        before = energy_of(world)
    else:
        raise AssertionError("they never came to rest")
    assert energy_of(world) < start


@given(angle=st.floats(0, 2 * np.pi), speed=st.floats(0.5, 10))
@settings(max_examples=15, deadline=None)
def test_box_moves_away_from_the_sphere_that_hits_it(angle, speed):
    way = (np.cos(angle), 0.0, np.sin(angle))
    world = pushed(speed, way)
    moved = world.positions[0] * [1, 0, 1]
    # At 0.1 m along its way the sphere of 0.06 m stops; the box of 0.2 m is ahead of it.
    assert moved @ np.array(way) > 0.1 + 0.06 + 0.08
    assert (
        np.linalg.norm(moved - (moved @ np.array(way)) * np.array(way)) < 0.35 * np.linalg.norm(moved) + 0.05
    )


@pytest.mark.parametrize("speed", [1.0, 3.0, 6.0])
def test_box_is_pushed_at_the_spheres_speed(speed):
    """As in a collision with a heavy body, the box leaves at the sphere's speed or slightly faster."""
    fastest = 0.0
    world = World(boxes(), UNBOUND)
    world.set_state(slice(None), np.array([[0.0, 0.1, 0.0]]))
    for k in range(30):
        world.move(np.array([[min(-0.4 + speed * k * FRAME, 0.1), 0.12, 0.0]]), np.array([0.06]))
        world.advance(FRAME)
        fastest = max(fastest, world.velocities[0, 0])
    assert 0.9 * speed < fastest < 1.35 * speed


def test_teleported_sphere_does_not_push_the_box_at_its_speed():
    """This is why contacts are corrected: the engine treats mocap bodies as having no velocity."""
    world = World(boxes(), UNBOUND)
    world.set_state(slice(None), np.array([[0.0, 0.1, 0.0]]))
    for k in range(12):
        world.move(np.array([[min(-0.4 + 6.0 * k * FRAME, 0.3), 0.12, 0.0]]), np.array([0.06]))
        world.mark_as_new(slice(0, 1))  # it is teleported in every frame, so it has no velocity
        world.advance(FRAME)
    assert world.velocities[0, 0] < 0.5 * 6.0


def test_character_appearing_inside_a_tower_does_not_explode_it():
    world = tower()
    run(world, 0.2)
    cloud = np.random.default_rng(0).uniform([-0.2, 0, -0.2], [0.2, 1.2, 0.2], (60, 3))
    highest = 0.0
    for _ in range(60):
        world.move(cloud, np.full(60, 0.08))
        assert world.advance(FRAME) == ""
        highest = max(highest, float(np.linalg.norm(world.velocities[:, :3], axis=1).max()))
    # A fall from the tower's height gives the maximum speed.
    assert highest < np.sqrt(2 * 9.81 * 1.2) + 1.0
    assert np.abs(world.positions).max() < 4


def test_a_ball_bounces_as_high_as_it_should_and_comes_to_rest():
    world = World(balls(bounce=0.7), UNBOUND)
    world.set_state(slice(None), np.array([[0.0, 1.1, 0.0]]))
    heights = []
    for _ in range(900):
        world.advance(0.005)
        heights.append(float(world.positions[0, 1]) - 0.1)
    landed = int(np.argmax(np.array(heights) < 0.02))
    assert max(heights[landed:]) == pytest.approx(0.49, abs=0.12)
    assert abs(heights[-1]) < 0.005


@given(seed=st.integers(0, 999))
@settings(max_examples=5, deadline=None)
def test_chaos_stays_finite(seed):
    rng = np.random.default_rng(seed)
    world = tower()
    for k in range(60):
        cloud = rng.uniform(-1, 1, (20, 3)) * 10 ** rng.uniform(-1, 1)
        cloud[rng.random(20) < 0.1] = rng.choice([np.nan, np.inf, 1e30, -1e30])
        world.move(cloud, rng.uniform(-0.1, 0.5, 20))
        world.advance(float(rng.choice([0.0, 0.001, FRAME, 0.5, 10.0, -1.0])))
        assert np.isfinite(world.positions).all() and np.isfinite(world.velocities).all(), k
        assert np.linalg.norm(world.velocities[:, :3], axis=1).max() <= MAX_PROP_SPEED_M_S * (1 + 1e-9)


@pytest.mark.slow
def test_five_minutes_of_rampage_stay_in_the_room():
    """Limbs swing through a pile repeatedly, and sometimes jump."""
    world, rng = tower(4), np.random.default_rng(2)
    limb = np.stack([np.zeros(6), np.linspace(0.1, 0.9, 6), np.zeros(6)], 1)
    farthest = 0.0
    for k in range(9000):
        if k % 300 == 0:
            world.set_state(slice(None), np.array([[0, 0.1 + 0.2 * j, 0] for j in range(4)]))
        swing = 0.6 * np.sin(0.3 * k * np.array([1.0, 0.0, 0.73]))
        leap = rng.normal(size=3) if rng.random() < 0.02 else np.zeros(3)
        world.move(limb + swing + leap, np.full(6, 0.08))
        assert world.advance(FRAME) == "", k
        farthest = max(farthest, float(np.abs(world.positions).max()))
        assert world.positions[:, 1].min() > -0.05, "through the floor"
    # Boxes fly at most a few metres in the ten seconds until they are put back.
    assert farthest < 40


def test_broken_world_is_reported_and_can_restart():
    world = tower()
    world.velocities[1, 2] = np.nan
    assert "not a finite number" in world.advance(FRAME)
    world.restart()
    world.set_state(slice(None), np.array([[0, 0.1 + 0.2 * k, 0] for k in range(5)]))
    run(world, 0.5)
    world.positions[0] = (1e6, 1, 1)
    assert "thrown too far" in world.advance(FRAME)


def test_more_spheres_than_there_is_room_for_change_nothing_else():
    world = pushed(2.0)
    before, speed = world.positions.copy(), world.velocities.copy()
    world.move(np.full((200, 3), 5.0), np.full(200, 0.05))
    np.testing.assert_array_equal(world.positions, before)
    np.testing.assert_array_equal(world.velocities, speed)


def test_removed_sphere_touches_nothing():
    world = tower(1)
    for radius in (0.1, 0.0):
        world.move(np.array([[0.0, 0.25, 0.0]]), np.array([radius]))
        world.advance(FRAME)
        assert (world.touched[0] == 0) == (radius > 0)


def test_the_same_pushes_give_the_same_places():
    np.testing.assert_array_equal(pushed(4.0).positions, pushed(4.0).positions)


def test_a_bounded_frame_leaves_time_out():
    world = World(boxes(), type(UNBOUND)(budget=1e-9))
    world.set_state(slice(None), np.array([[0.0, 3.0, 0.0]]))
    world.advance(FRAME)
    assert 0 < world.left_out < FRAME


def test_corrected_contacts_are_those_of_the_plain_rule():
    rng = np.random.default_rng(5)
    count, spheres = 12, 4
    owner = np.array([FLOOR, 0, 1, 2, 3, -3, -4])
    geoms = rng.integers(0, 7, (count, 2), np.int32)
    frames = np.stack([np.linalg.qr(rng.normal(size=(3, 3)))[0].ravel() for _ in range(count)])
    distances, addresses = rng.uniform(-0.1, 0.01, count), 3 * np.arange(count, dtype=np.int32)
    addresses[3] = -1
    impedance = rng.uniform(0.5, 2.0, (3 * count, 4))
    impedance[1::3, 0] = impedance[2::3, 0] = 0
    reference, approach = rng.normal(size=3 * count), rng.normal(size=3 * count)
    velocities, bounce = rng.normal(size=(spheres, 3)), np.array([0.0, 0.6])
    slow, closing = reference.copy(), approach.copy()
    for c in range(count):
        if (row := addresses[c]) < 0:
            continue
        k, b, d = impedance[row, :3]
        slow[row] += k * d * min(0.0, distances[c] + 0.8 * b / (k * d))
        of = [velocities[o] if o >= 0 else np.zeros(3) for o in owner[geoms[c]]]
        along = frames[c].reshape(3, 3) @ (of[1] - of[0])
        slow[row : row + 3] -= impedance[row : row + 3, 1] * along
        closing[row : row + 3] += along
        spring = max([bounce[-3 - o] for o in owner[geoms[c]] if o <= -3], default=0.0)
        if spring > 0 and closing[row] < -0.5:
            slow[row] = max(slow[row], -(1 + spring) * closing[row] / 0.004)
    touched = np.full(2, NOTHING)
    dims = np.full(count, 3, np.int32)
    correct_contacts(
        geoms, frames, distances, addresses, dims, reference, impedance, approach, owner, velocities, bounce,
        0.8, 0.004, touched,
    )  # fmt: skip
    np.testing.assert_allclose(reference, slow, atol=1e-12)
    np.testing.assert_allclose(approach, closing, atol=1e-12)


def test_speeds_are_limited_and_nan_is_reported():
    speeds = np.array([[3.0, 4.0, 0, 0, 0, 50.0], [1, 0, 0, 0, 0, 0]])
    assert limit_speeds(speeds, 2.5, 10.0)
    np.testing.assert_allclose(speeds, [[1.5, 2.0, 0, 0, 0, 10.0], [1, 0, 0, 0, 0, 0]])
    assert not limit_speeds(np.full((1, 6), np.nan), 1.0, 1.0)


def test_missing_engine_is_reported_with_the_install_command(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert "mujoco" in sys.modules
    with pytest.raises(ResourceError, match=r"enliven-edge\[physics\]"):
        need("mujoco", "physics", "--physics")
