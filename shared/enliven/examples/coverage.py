"""Measures how well a puppet's examples cover the takes that it plays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.document import ExampleCharacter, Project
from enliven.examples.puppet_examples import collect_motion_inputs
from enliven.examples.puppet_solve import convert_to_reference
from enliven.examples.suggest import distance_to

_SAME_POSE_DISTANCE = 1e-3
"""Maximum distance of the control points of two equal key poses, as a fraction of the mesh's size."""


@dataclass(frozen=True)
class Coverage:
    """The coverage of a take by the examples: the distance of its poses from the nearest examples.

    Attributes:
        take: id of the take.
        gap: the largest distance between a pose of the take and the example nearest to it, metres (root mean
            square over the joints).
        frame, time: frame and time (seconds) in the take of the pose with this gap.
        share: the gap divided by the largest distance between two examples.
    """

    take: str
    gap: float
    frame: int
    time: float
    share: float

    def __str__(self) -> str:
        return (
            f"{self.take}: the pose that differs most from all examples is {self.gap:.3f} m from "
            "the nearest example "
            f"({self.share:.0%} of the largest distance between two examples), at {self.time:.2f} s "
            f"(frame {self.frame})"
        )


def measure_coverage(project: Project, puppet: ExampleCharacter, layer: int) -> Coverage:
    """Computes how well the examples cover the take of a layer.

    Raises:
        InputError: if data is missing.
    """
    material = collect_motion_inputs(project, puppet, puppet.layers[layer])
    examples, performance = convert_to_reference(material)
    distances = distance_to(performance.poses, examples.sources)
    frame = int(distances.argmax())
    largest_distance = max(
        float(distance_to(examples.sources, pose[None]).max()) for pose in examples.sources
    )
    gap = float(distances[frame])
    return Coverage(puppet.layers[layer].take, gap, frame, frame * performance.step, gap / largest_distance)


def describe_unposed(puppet: ExampleCharacter) -> tuple[str, ...]:
    """Returns a sentence for the user if all key poses are equal, because none has been edited yet. Otherwise
    returns an empty tuple.
    """
    if len(puppet.poses) < 2:
        return ()
    tolerance = _SAME_POSE_DISTANCE * float(np.linalg.norm(np.ptp(puppet.mesh.vertices, axis=0)))
    are_equal = all(np.abs(pose.places - puppet.poses[0].places).max() <= tolerance for pose in puppet.poses)
    return ("All key poses are equal: move the control points of the key poses.",) if are_equal else ()
