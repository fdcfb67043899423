"""Measures how well a puppet's examples cover the takes that it plays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.document import Project, Puppet
from enliven.examples.puppet_examples import collect_material
from enliven.examples.puppet_solve import convert_to_reference
from enliven.examples.suggest import distance_to

_SAME_POSE_DISTANCE = 1e-3
"""Maximum distance of the control points of two equal key poses, as a fraction of the mesh's size."""


@dataclass(frozen=True)
class Coverage:
    """The distance of the poses of a take from the examples.

    Attributes:
        take: id of the take.
        gap: the largest distance of a pose from its nearest example, in metres (root mean square over the
            joints).
        frame, time: frame and time in seconds of that pose in the take.
        share: the gap divided by the largest distance between two examples.
    """

    take: str
    gap: float
    frame: int
    time: float
    share: float

    def __str__(self) -> str:
        return (
            f"{self.take}: the pose farthest from all examples is {self.gap:.3f} m away "
            f"({self.share:.0%} of the farthest two examples), at {self.time:.2f} s (frame {self.frame})"
        )


def measure_coverage(project: Project, puppet: Puppet, layer: int) -> Coverage:
    """Computes how well the examples cover the take of a layer.

    Raises:
        InputError: if data is missing.
    """
    material = collect_material(project, puppet, puppet.layers[layer])
    examples, took = convert_to_reference(material)
    away = distance_to(took.poses, examples.sources)
    frame = int(away.argmax())
    apart = max(float(distance_to(examples.sources, pose[None]).max()) for pose in examples.sources)
    gap = float(away[frame])
    return Coverage(puppet.layers[layer].take, gap, frame, frame * took.step, gap / apart)


def describe_unposed(puppet: Puppet) -> tuple[str, ...]:
    """Returns a sentence if all key poses are equal, because none has been posed yet. Otherwise the result is
    empty."""
    if len(puppet.poses) < 2:
        return ()
    near = _SAME_POSE_DISTANCE * float(np.linalg.norm(np.ptp(puppet.mesh.vertices, axis=0)))
    same = all(np.abs(pose.places - puppet.poses[0].places).max() <= near for pose in puppet.poses)
    return ("All key poses are alike: set the places of the control points.",) if same else ()
