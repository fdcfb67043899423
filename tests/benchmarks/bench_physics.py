"""Measures the cost of loose objects: a frame with 100 spheres and 50 boxes, at rest and while a character
runs into them.

It also measures two other ways of moving the spheres: the engine's own mocap bodies, and heavy bodies whose
position and speed are set in every step. Their results explain why contacts are corrected.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import mujoco
import numpy as np
from figure import Figure

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.deformation.spheres import pack_spheres
from enliven.document.props import BOX
from enliven.samples.shipped import load_sample
from enliven_edge.physics.settings import EngineSettings
from enliven_edge.physics.world import CONTACT_TIME_S, MAX_SUBSTEP_S, PropSpecs, World

FRAME = 1 / 30
SPHERES, BOXES, SIDE = 100, 50, 0.17
SETTINGS = EngineSettings(budget=0.0)
SPEED = 6.0
"""Speed at which one box is hit in the comparison, metres per second."""


def figures() -> Iterator[Figure]:
    """Yields times of frames and kernels, and the response of a box to an impact."""
    world, cloud = _towers(), _cloud()
    rest = _time_frames(world, lambda k: cloud + np.array([-3.0, 0, 0]), 90)
    world = _towers()
    path = [np.array([-1.5 + 0.06 * k, 0, 0.2 * np.sin(0.5 * k)]) for k in range(90)]
    rampage = _time_frames(world, lambda k: cloud + path[k], 90)
    yield Figure("physics.step_ms", float(np.median(rest)), "ms")
    yield Figure("physics.share_of_frame", float(np.median(rest)) / (1e3 * FRAME), "of 33 ms")
    yield Figure("physics.rampage_ms", float(np.median(rampage)), "ms")
    yield Figure("physics.rampage_worst_ms", float(np.max(rampage)), "ms")
    character = _make_chair()
    begin = time.perf_counter()
    proxies = pack_spheres(character)
    yield Figure("physics.pack_chair_ms", 1e3 * (time.perf_counter() - begin), "ms")
    yield Figure("physics.spheres_of_chair", float(len(proxies)), "spheres")
    pose, out = character.rest_pose(), np.empty_like(proxies.rest)
    yield Figure("physics.centres_us", 1e6 * _time_fastest(lambda: proxies.centres(pose, out)), "us")
    mocap, heavy, ours = (
        _measure_engine_blow(heavy=False),
        _measure_engine_blow(heavy=True),
        _measure_our_blow(),
    )
    yield Figure("physics.blow_depth_mm", 1e3 * ours, "mm", "mocap bodies", mocap / ours)
    yield Figure("physics.blow_depth_heavy_mm", 1e3 * heavy, "mm")


def _boxes(count: int) -> PropSpecs:
    half = np.full((count, 3), SIDE / 2)
    plain = np.full(count, BOX, np.uint8), half, np.full(count, 0.35), np.zeros((count, 3), np.uint8)
    return PropSpecs(*plain, np.zeros(count))


def _towers() -> World:
    """Returns ten stacks of five boxes, in two rows."""
    world = World(_boxes(BOXES), SETTINGS)
    n = np.arange(BOXES)
    stack = n // 5
    places = np.stack([stack // 2 * 1.1 * SIDE, (n % 5 + 0.5) * SIDE, stack % 2 * 1.1 * SIDE], 1)
    world.set_state(slice(None), places)
    return world


def _cloud() -> np.ndarray:
    """Returns (100, 3) positions of spheres that form a body as tall as a person."""
    grid = np.meshgrid(np.linspace(-0.2, 0.2, 4), np.linspace(0.1, 1.7, 5), np.linspace(-0.2, 0.2, 5))
    return np.stack(grid, -1).reshape(-1, 3)


def _time_frames(world: World, where: Callable[[int], np.ndarray], count: int) -> list[float]:
    """Returns the milliseconds of every frame except the first ones."""
    took = []
    for k in range(count):
        begin = time.perf_counter()
        world.move(where(k), np.full(SPHERES, 0.06))
        assert world.advance(FRAME) == ""
        took.append(1e3 * (time.perf_counter() - begin))
    return took[10:]


def _make_chair() -> Any:
    mesh = load_sample("chair")
    return character_from_graph(mesh, DeformationGraph.build(mesh, nodes=128), "chair")


def _time_fastest(call: Callable[[], Any]) -> float:
    """Returns the seconds of the fastest of many calls."""
    best = np.inf
    for _ in range(2000):
        begin = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - begin)
    return best


def _find_blow_position(k: int) -> list[float]:
    """Returns the sphere's position after ``k`` time steps. It passes the box's position at full speed, then
    stops.
    """
    return [min(-0.4 + SPEED * k * MAX_SUBSTEP_S, 0.2), 0.1, 0.0]


def _compute_depth(k: int, box: float) -> float:
    """Returns the penetration depth of the sphere in the box centred at x = ``box`` while it still moves,
    metres."""
    return _find_blow_position(k)[0] + 0.06 - (box - SIDE / 2)


def _measure_our_blow() -> float:
    """Returns the penetration depth of a sphere in one box that it hits, metres."""
    world, deepest = World(_boxes(1), SETTINGS), 0.0
    world.set_state(slice(None), np.array([[0.0, SIDE / 2, 0.0]]))
    for k in range(round(0.5 / MAX_SUBSTEP_S)):
        deepest = max(deepest, _compute_depth(k, float(world.positions[0, 0])))
        world.move(np.array([_find_blow_position(k + 1)]), np.array([0.06]))
        world.advance(MAX_SUBSTEP_S)
    return deepest


def _measure_engine_blow(heavy: bool) -> float:
    """Returns the penetration depth with the engine alone: a mocap body, or a 200 kg body that is placed in
    every step.
    """
    step, half = MAX_SUBSTEP_S, SIDE / 2
    contact = f'solref="{CONTACT_TIME_S} 1" friction="{SETTINGS.friction} 0.005 0.0005"'
    slides = (
        "".join(f'<joint type="slide" axis="{a}"/>' for a in ("1 0 0", "0 1 0", "0 0 1")) if heavy else ""
    )
    model = mujoco.MjModel.from_xml_string(f"""
      <mujoco><option timestep="{step}" gravity="0 -9.81 0" cone="elliptic" integrator="implicitfast"/>
      <worldbody><geom type="plane" size="0 0 1" quat="0.70710678 -0.70710678 0 0" {contact}/>
      <body {'gravcomp="1"' if heavy else 'mocap="true"'}>{slides}
        <geom type="sphere" size="0.06" mass="200" contype="2" conaffinity="1" {contact}/></body>
      <body pos="0 {half} 0"><freejoint/>
        <geom type="box" size="{half} {half} {half}" mass="0.35" conaffinity="3" {contact}/></body>
      </worldbody></mujoco>""")
    data, deepest = mujoco.MjData(model), 0.0
    for k in range(round(0.5 / step)):
        deepest = max(deepest, _compute_depth(k, float(data.qpos[-7])))
        if heavy:
            data.qpos[:3], data.qvel[:3] = (
                _find_blow_position(k),
                [SPEED * (_find_blow_position(k)[0] < 0.2), 0.0, 0.0],
            )
        else:
            data.mocap_pos[0] = _find_blow_position(k)
        mujoco.mj_step(model, data)
    return deepest
