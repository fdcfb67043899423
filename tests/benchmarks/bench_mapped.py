"""Measures which arms and legs are found in ten human-like meshes, and how long that takes.

The peer is what `how = "mapped"` did before: extremities are head, hands and feet by height alone.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
from figure import Figure
from known_bodies import BODIES, limbs_found

from enliven.deformation.graph import DeformationGraph
from enliven.possession.likeness import find_body_in_mesh
from enliven.possession.likeness.any_mesh import body_by_extremities

PEER = "extremities by height alone"


def figures() -> Iterator[Figure]:
    """Limbs found, bodies found without a doubt, and processor time."""
    found, before, certain, times = 0, 0, 0, []
    for make in BODIES.values():
        known = make()
        graph = DeformationGraph.build(known.mesh, nodes=128)
        start = time.process_time()
        like = find_body_in_mesh(known.mesh, graph)
        times.append(1e3 * (time.process_time() - start))
        found += sum(limbs_found(like.joints, known).values())
        before += sum(limbs_found(body_by_extremities(graph).joints, known).values())
        certain += not like.doubts
    yield Figure("mapped.limbs", found, "of 40 arms and legs", PEER, found / before)
    yield Figure("mapped.certain", certain, "of 10 bodies")
    yield Figure("mapped.find_ms", float(np.median(times)), "ms of processor time")
