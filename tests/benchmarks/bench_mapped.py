"""Measures which limbs are found in ten human-like meshes, and how well the meshes follow a spinning
performer's heading.

The peer is the earlier method of `how = "mapped"`: extremities are assigned to head, hands and feet by height
alone.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
from figure import Figure
from known_bodies import BODIES, KnownBody, compare_limbs
from turning_measures import measure_turning
from turning_people import metres_from_bone

from enliven.arrays import Float
from enliven.deformation.graph.graph import DeformationGraph
from enliven.meshes import Mesh
from enliven.person.joints import Joint
from enliven.possession import ActorSettings, make_standing_figure
from enliven.possession.attachment.bone_attachment import ReachGrowth, attach
from enliven.possession.likeness.any_mesh import body_from_extremities
from enliven.possession.likeness.finding import find_body_in_mesh
from enliven.possession.preparation import apply_vertex_motion, prepare_mesh

PEER = "extremities by height alone"


_TRUNK = [Joint.HIP_LEFT, Joint.HIP_RIGHT, Joint.SHOULDER_LEFT, Joint.SHOULDER_RIGHT]
_LIMB_OF = np.repeat(np.arange(5), 4)
"""(20,) the limb of each joint: trunk and head, arms, legs."""
_NEAR = 1.5
"""A point counts as another limb's skin if its distance exceeds this multiple of the distance to its own
limb's nearest bone.
"""


def figures() -> Iterator[Figure]:
    """Yields limbs found, bodies found with certainty, processor time, the performer's position, and the
    attachment."""
    limb_count, before, certain, times = 0, 0, 0, []
    off, far = [], []
    for make in BODIES.values():
        body = make()
        graph = DeformationGraph.build(body.mesh, nodes=128)
        start = time.process_time()
        like = find_body_in_mesh(body.mesh, graph)
        times.append(1e3 * (time.process_time() - start))
        limb_count += sum(compare_limbs(like.joints, body).values())
        before += sum(compare_limbs(body_from_extremities(graph).joints, body).values())
        certain += not like.doubts
        fitted, joints = _convert_to_fitted(body)
        off.append(100.0 * float(np.linalg.norm((joints - make_standing_figure())[_TRUNK].mean(0)[[0, 2]])))
        far.append(100.0 * _find_held_far(fitted, joints))
    yield Figure("mapped.limbs", limb_count, "of 40 arms and legs", PEER, limb_count / before)
    yield Figure("mapped.certain", certain, "of 10 bodies")
    yield Figure("mapped.stand_off_cm", max(off), "cm from back to back, the worst of ten")
    yield Figure("mapped.held_far_pct", float(np.mean(far)), "% of the hold is on another limb's skin")
    yield Figure("mapped.held_far_worst_pct", max(far), "% in the worst of ten")
    yield Figure("mapped.find_ms", float(np.median(times)), "ms of processor time")
    yield from _measure_turning()


def _measure_turning() -> Iterator[Figure]:
    """Yields the heading error of each of the ten bodies, from the first frame on."""
    films = [
        measure_turning(make().mesh, how, seed)
        for seed, make in enumerate(BODIES.values())
        for how in ("mapped", "inside")
    ]
    off = np.concatenate([film.off_deg for film in films])
    yield Figure("mapped.heading_deg_max", float(off.max()), "degrees off the performer's heading, the worst")
    yield Figure(
        "mapped.heading_deg_p90", float(np.percentile(off, 90)), "degrees, nine frames in ten have less"
    )
    yield Figure("mapped.place_m_first", max(film.first_m for film in films), "m off in the first frame")


def _convert_to_fitted(known: KnownBody) -> tuple[Mesh, Float]:
    """Returns the mesh placed so that a standing performer fits into it, and its own (20, 3) joints there,
    metres."""
    fitted, _ = prepare_mesh(known.mesh, ActorSettings())
    return fitted, apply_vertex_motion(
        known.joints, known.mesh.vertices, fitted.vertices[: len(known.mesh.vertices)]
    )


def _find_held_far(mesh: Mesh, joints: Float) -> float:
    """Returns the fraction of attached points that are on another limb, for a performer in the mesh's own
    pose."""
    graph, settings = DeformationGraph.build(mesh, nodes=128), ActorSettings()
    grow = ReachGrowth(settings.enough, settings.farthest_reach)
    held = attach(graph, joints, np.ones(20), settings=settings.attachment, grow=grow)
    apart = np.stack([metres_from_bone(graph.positions, joints, joint) for joint in range(1, 20)], 1)
    limbs = np.stack([apart[:, _LIMB_OF[1:] == limb].min(1) for limb in range(5)], 1)
    own = limbs[held.node_indices, _LIMB_OF[held.bone][:, None]]
    other = own > _NEAR * limbs[held.node_indices].min(2)
    return float((held.node_weights * other).sum() / held.node_weights.sum())
