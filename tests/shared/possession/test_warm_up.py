"""Tests that after an actor's warm-up, no frame compiles a kernel or loads one from disk."""

import subprocess
import sys

import pytest

PLAYED = """
import gc
import numpy as np
from numba.core.dispatcher import Dispatcher
from enliven.samples.shipped import load_sample
from enliven.deformation.constraints.observed import ObservedPoints
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.person import Body, J
from enliven.possession import ActorSettings, EmbeddedActor
from enliven.possession.likeness.standing_person import make_standing_figure

def kernels():
    return {d: len(d.signatures) for d in gc.get_objects() if isinstance(d, Dispatcher)}

def person(number, time):
    joints = make_standing_figure() + [0.6 * number + 0.2 * np.sin(3 * time), 0.0, 0.0]
    joints[:, 2] += 0.3 * np.sin(5 * time + 4 * joints[:, 1])
    return Body(number, joints, np.ones(J))

mesh = load_sample("chair")
graph = DeformationGraph.build(mesh, nodes=NODES, seed=0)
actor = EmbeddedActor(character_from_graph(mesh, graph, "chair"), graph, ActorSettings())
if WARM:
    actor.warm_up()
before, renewed = kernels(), 0
for frame in range(90):
    bodies = [person(number, frame / 30) for number in (0, 1)]
    seen = {0: ObservedPoints(bodies[0].joints, np.tile([0.0, 0.0, 1.0], (J, 1)))} if frame > 60 else None
    actor.perform(bodies, frame * 33_333_333, seen)
    if frame in (0, 40):
        actor.possess(bodies[frame > 0])
    renewed += actor._solver is not None and actor._solver._matrix._pending is not None
assert actor.holds and renewed
print(*sorted({d.py_func.__name__ for d, n in kernels().items() if n > before.get(d, 0)}))
"""
"""Prints the kernels that gained a signature while two people possessed a chair, one after the other."""


def kernels_of(nodes: int, *, warm: bool) -> set[str]:
    """Returns the kernels that live frames compiled or loaded, in a separate process."""
    command = [sys.executable, "-c", f"WARM, NODES = {warm}, {nodes}\n{PLAYED}"]
    shown = subprocess.run(command, capture_output=True, text=True, timeout=600, check=True)
    return set(shown.stdout.split())


@pytest.mark.timeout(700)
@pytest.mark.parametrize("nodes", [40, 230])
def test_warm_up_compiles_all_kernels(nodes):
    """The node counts are below and above the threshold for recomputing the matrix after every frame."""
    assert kernels_of(nodes, warm=True) == set()


@pytest.mark.slow
@pytest.mark.timeout(700)
def test_first_frames_without_warm_up_load_kernels():
    assert {"next_frame", "refactorize_matrix"} <= kernels_of(40, warm=False)
