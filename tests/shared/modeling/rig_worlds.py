"""Projects with one character of each rig type, with or without keys on its root and its nodes."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
import made_puppets
from cage import Swing, cage_of
from surgery_worlds import bending_arm, tube
from swaying import possessed_chair

from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.document import (
    Layer,
    Pose,
    PoseStream,
    Project,
    PuppetLayer,
    Switch,
    graph_shape_from_poses,
)
from enliven.modeling.edits import set_key
from enliven.rotation import from_rotation_vector, to_matrix

RIGS = ("bones", "graph", "points", "cage", "possessed")
GRAPHS = ("graph", "possessed")


def skeleton_world():
    """Returns an arm that a take bends. Its root follows the take's root."""
    project = bending_arm()
    shape = project.shape("arm")
    way = Layer("way", "bend", (0,), from_rotation_vector([0.0, 0.7, 0.0]), offset=0.2, speed=0.5, loop=True)
    take = project.takes["bend"]
    walking = type(take)("bend", take.skeleton, take.turns, np.array([[0, 0, 0], [0.4, 0.1, 0.2]]), 1.0)
    moving = shape.with_changes(layers=(*shape.layers, way), travel="way", place=[0.3, 0.0, -0.2])
    return project.with_takes(walking).with_characters(moving), "arm"


def graph_world():
    """Returns a possessed tube. Each node bends and sways independently."""
    mesh = tube(length=2.0, around=8, along=13)
    graph = DeformationGraph.build(mesh, 10, seed=1)
    character, poses = character_from_graph(mesh, graph, "post"), []
    for frame in range(8):
        sway = 0.4 * np.sin(frame / 2 + graph.positions[:, 0])
        turns = to_matrix(from_rotation_vector(np.stack([0 * sway, 0.4 * sway, sway], 1)))
        moved = graph.positions + np.stack([0.05 * frame + 0 * sway, 0.3 * sway, 0.1 * sway], 1)
        poses.append(Pose("post", round(frame * 2e8), turns.astype(np.float32), moved.astype(np.float32)))
    shape, stream = graph_shape_from_poses(character, poses, "sway")
    return Project().with_streams(stream).with_characters(shape), "post"


def puppet_world():
    """Returns a bean that dances by three examples, and travels."""
    # A jumping puppet falls at the same speed whatever its size, so this one never jumps.
    first = PuppetLayer("dance", offset=0.1, speed=0.8, switches=(Switch(0, "contact"),))
    layers = (first, PuppetLayer("dance", ("near",), weight=0.4))
    mesh = made_puppets.tube(rings=10, around=8)
    bean = made_puppets.puppet(mesh=mesh, layers=layers, place=[0.5, 0.0, 0.1])
    return Project().with_takes(made_puppets.take()).with_characters(bean), "bean"


def cage_world():
    """Returns a tube in a tetrahedron whose corners swing."""
    times = np.arange(8)[:, None, None]
    ways = 0.3 * np.sin(times / 2 + np.arange(12).reshape(4, 3))
    stream = PoseStream("swing", np.tile(np.eye(3), (8, 4, 1, 1)), ways, 0.2)
    cage = cage_of(tube(length=2.0, around=8, along=9), "box", (Swing("swing", offset=0.1, speed=0.7),))
    return Project().with_streams(stream).with_characters(cage), "box"


MADE = (skeleton_world(), graph_world(), puppet_world(), cage_world(), possessed_chair(frames=45))
WORLDS = dict(zip(RIGS, MADE, strict=True))


def with_keys(project, name, seed=3):
    """Returns the project with root keys that rotate and move the character, and keys of a node if it has
    nodes.
    """
    random = np.random.default_rng(seed)
    things = [None, *([4] if project.character(name).kind == "graph" else [])]
    for thing in things:
        for time in (0.0, 0.7, 1.3):
            degrees = 50 * random.normal(size=3)
            project = set_key(project, name, thing, time, degrees, metres=0.3 * random.normal(size=3))
    return project


for rig in RIGS[:4]:
    WORLDS[f"keyed {rig}"] = (with_keys(*WORLDS[rig]), WORLDS[rig][1])

ALL = tuple(WORLDS)
rigs = pytest.mark.parametrize("rig", RIGS)
worlds = pytest.mark.parametrize("rig", ALL)


def kind(rig):
    """Returns the rig kind of a test project, with or without keys."""
    return rig.split()[-1]
