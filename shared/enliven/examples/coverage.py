"""How well a puppet's examples cover what it plays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from enliven.document import Project, Puppet
from enliven.examples.puppet_examples import material_of
from enliven.examples.puppet_solve import seen_by
from enliven.examples.suggest import distance_to

_SAME = 1e-3
"""Share of the mesh's size by which control points of two key poses are apart at most, to be posed alike."""


@dataclass(frozen=True)
class Coverage:
    """How far the poses of a take are from the examples.

    Attributes:
        take: its id.
        gap: metres, a root mean square over the joints: the farthest pose from the example nearest to it.
        frame, time: of that pose, in the take; seconds.
        share: the gap as a share of how far the examples are apart at most.
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


def coverage_of(project: Project, puppet: Puppet, layer: int) -> Coverage:
    """How well the examples cover the take of a layer.

    Raises:
        InputError: where something is missing.
    """
    material = material_of(project, puppet, puppet.layers[layer])
    examples, took = seen_by(material)
    away = distance_to(took.poses, examples.sources)
    frame = int(away.argmax())
    apart = max(float(distance_to(examples.sources, pose[None]).max()) for pose in examples.sources)
    gap = float(away[frame])
    return Coverage(puppet.layers[layer].take, gap, frame, frame * took.step, gap / apart)


def unposed(puppet: Puppet) -> tuple[str, ...]:
    """A sentence where all key poses are alike, since none has been posed yet; else nothing."""
    if len(puppet.poses) < 2:
        return ()
    near = _SAME * float(np.linalg.norm(np.ptp(puppet.mesh.vertices, axis=0)))
    same = all(np.abs(pose.places - puppet.poses[0].places).max() <= near for pose in puppet.poses)
    return ("All key poses are alike: say where the control points are to be.",) if same else ()
