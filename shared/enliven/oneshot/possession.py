"""Animates a mesh by performers who stand inside it (KinÊtre, 2012)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace

from enliven.document import BodyTake, HoldChange, Possession, Project
from enliven.errors import InputError
from enliven.frames import BodyFrame
from enliven.meshes import Mesh
from enliven.modeling.possessed.solving import possess_mesh
from enliven.motion_clips.body_takes import body_take_from_frames
from enliven.person import Body, parse_parts
from enliven.possession import ActorSettings

_ATTACHED_IN_PLACE_SETTINGS = ActorSettings(place="fixed", fade=0.0)
"""Settings for a mesh that stays at its modeled position and follows the performer without easing."""


def possess(
    mesh: Mesh,
    bodies: Sequence[Body] | BodyTake,
    step: float = 1 / 30,
    *,
    parts: str = "all",
    nodes: int = 128,
    holds: Sequence[HoldChange] = (),
    settings: ActorSettings = _ATTACHED_IN_PLACE_SETTINGS,
    project: Project | None = None,
) -> tuple[Project, str]:
    """Adds a mesh that moves with a performer, attached in the first frame.

    In the first frame, the performer stands inside the mesh, and the body parts near the surface attach to
    the mesh. The project stores the performer's motion. So after the mesh was cut or edited, ``solve_again``
    in :mod:`enliven.modeling.possessed` can compute its motion again.

    Args:
        mesh: any triangle mesh, in metres in the world.
        bodies: a take, or the bodies (F,) of one performer at even time steps. Joints (20, 3) are in metres
            in the world.
        step: seconds from one body to the next.
        parts: parts of the body that attach: "all", "legs", "hip + right arm", ...
        nodes: number of nodes of the deformation graph.
        holds: the times at which performers attach and release. If given, ``parts`` is ignored.
        settings: settings of the mesh's approach to its performers and of the motion transfer. By default the
            mesh stays at its position.
        project: the project that the mesh is added to. If None, a new project is created.

    Returns:
        The project, and the id of the mesh in it.

    Raises:
        InputError: if no part of the mesh is within reach, or there are fewer than two bodies.
    """
    where = f"mesh {mesh.name or 'mesh'!r}"
    count = len(bodies.seconds if isinstance(bodies, BodyTake) else bodies)
    if count < 2:
        raise InputError(
            f"a motion needs at least two bodies, but {count} were passed",
            where=where,
            remedy="Pass more bodies.",
        )
    take = bodies if isinstance(bodies, BodyTake) else _take_from_bodies(bodies, step, mesh.name)
    for part in [parts, *(change.parts for change in holds)]:
        parse_parts(part)
    changes = tuple(holds) or (HoldChange(0.0, parts=parts),)
    possession = Possession(take.id, changes, json.dumps(asdict(settings)))
    try:
        return possess_mesh(project or Project(), mesh, take, possession, nodes=nodes)
    except InputError as error:
        remedy = "Move or scale the mesh to where the performer stands (fit_height)."
        raise InputError(error.what, where=where, remedy=remedy) from None


def _take_from_bodies(bodies: Sequence[Body], step: float, name: str) -> BodyTake:
    """Returns the take of one performer with frames ``step`` seconds apart."""
    performer = bodies[0].id
    frames = [
        BodyFrame([replace(body, id=performer)], round(n * step * 1e9), "") for n, body in enumerate(bodies)
    ]
    return body_take_from_frames(frames, f"{name or 'mesh'} performed")
