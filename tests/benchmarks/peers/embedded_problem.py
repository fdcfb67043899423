"""Targets for the deformation solver: a chair attached to a motion-captured person that walks and jumps."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from enliven.arrays import Float
from enliven.deformation.embedded.solver import EmbeddedSolver
from enliven.deformation.graph.graph import DeformationGraph
from enliven.formats.motion.expmap import read_expmap
from enliven.possession.actor_settings import AttachmentSettings
from enliven.possession.attachment.bone_attachment import Attachment, attach
from enliven.samples.shipped import load_sample
from enliven_synthesis.body.performer import Performer
from enliven_synthesis.motion.mocap import CapturedMotion

DATA = Path(os.environ.get("ENLIVEN_DATA", Path(__file__).parents[4] / "shared" / "data")) / "cmu_expmap"
MOTIONS = ("test_walking_1.txt", "train_jumping_1.txt")
RATE = 30.0
_REACH = 0.3
"""Attachment distance in metres, at which every sample and joint of the body is attached (324
constraints).
"""
_EASE = 10
"""Number of frames from standing to the first pose of a motion."""


@dataclass(frozen=True)
class Problem:
    """A graph, its point constraints, and their targets.

    Attributes:
        targets: (F, L, 3) metres, frames at 30 a second; in the first frame, the points are at rest.
    """

    graph: DeformationGraph
    attachment: Attachment
    targets: Float


@cache
def joints_of(name: str) -> Float:
    """Returns (F, 20, 3) metres: the motion at 30 frames per second, starting above the origin."""
    motion = CapturedMotion(Performer(), read_expmap(DATA / name))
    # The first row of these files is a T-pose.
    times = np.arange(1, int(motion.duration * RATE)) / RATE
    joints = np.array([motion.figure(t).joints for t in times])
    return joints - joints[0, 0] * [1.0, 0.0, 1.0]


@cache
def problem(nodes: int) -> list[Problem]:
    """Returns one problem for each motion. The performer is attached in the jumper's standing pose before the
    jump."""
    graph = DeformationGraph.build(load_sample("chair"), nodes=nodes)
    standing = joints_of(MOTIONS[1])[0]
    held = attach(graph, standing, np.ones(20), settings=AttachmentSettings(reach=_REACH))
    out = []
    for name in MOTIONS:
        joints = joints_of(name)
        share = np.linspace(0.0, 1.0, _EASE, endpoint=False)[:, None, None]
        joints = np.concatenate([standing + share * (joints[0] - standing), joints])
        out.append(Problem(graph, held, np.array([held.targets(j) for j in joints])))
    return out


def wait_as_live(solver: EmbeddedSolver) -> None:
    """Waits until the solver's background thread has finished the last frame, as between two sensor frames.

    At 30 frames per second that thread finishes in time. Without the pause, each frame would wait for it and
    share the caches with it.
    """
    under_way = solver._matrix._pending
    if under_way is not None:
        under_way.result()
