"""A mesh moved by a performer who stands in it (KinÊtre, 2012)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from enliven.deformation.embedded import EmbeddedSolver
from enliven.deformation.graph import DeformationGraph, character_from
from enliven.document import Pose, Project, graph_shape_of, unused
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.person import Body
from enliven.possession import attach


def possess(
    mesh: Mesh,
    bodies: Sequence[Body],
    step: float = 1 / 30,
    *,
    parts: str = "all",
    nodes: int = 128,
    project: Project | None = None,
) -> tuple[Project, str]:
    """A project in which a mesh moves with a performer, who takes hold of it in the first frame.

    The body stands in the mesh: what of it is within reach of the surface takes hold. ``DeformationGraph``,
    ``attach`` and ``EmbeddedSolver`` do the work, and let more be chosen.

    Args:
        mesh: any triangles, in metres of the world.
        bodies: (F,) one performer at even steps; joints (20, 3) in metres of the world.
        step: seconds from one body to the next.
        parts: parts of the body that take hold: "all", "legs", "hip + right arm", ...
        nodes: nodes of the deformation graph.
        project: what the mesh is added to; None begins one.

    Returns:
        The project, and the id of the mesh in it.

    Raises:
        InputError: where no part of the mesh is in reach, or there are fewer than two bodies.
    """
    project = project or Project()
    graph = DeformationGraph.build(mesh, nodes)
    name = unused(mesh.name or "mesh", project.characters)
    if len(bodies) < 2:
        raise InputError(
            f"{len(bodies)} bodies do not move", where=f"mesh {name!r}", mend="Give two or more."
        )
    held = attach(graph, bodies[0].joints, bodies[0].confidence, parts)
    if not len(held):
        mend = "Move or scale the mesh to where the performer stands (fit_height)."
        raise InputError("no part of the mesh is in reach of the body", where=f"mesh {name!r}", mend=mend)
    solver, character, poses = EmbeddedSolver(graph, held), character_from(mesh, graph, name), list[Pose]()
    for frame, body in enumerate(bodies):
        linear, positions = solver.solve(held.targets(body.joints))
        time_ns = round(frame * step * 1e9)
        poses.append(Pose(name, time_ns, linear.astype(np.float32), positions.astype(np.float32)))
    shape, stream = graph_shape_of(character, poses, unused(name, project.streams), step)
    return project.with_streams(stream).with_characters(shape), name
