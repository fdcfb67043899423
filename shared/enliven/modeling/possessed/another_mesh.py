"""Transfers a possession to another mesh: the same performers, attachments and settings."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np

from enliven.arrays import Float
from enliven.document import BodyTake, Possession, Project
from enliven.meshes import Mesh
from enliven.modeling.possessed.solving import possess_mesh
from enliven.possession import prepare_for_actor, settings_from_possession


def possess_another(
    project: Project,
    mesh: Mesh,
    take: BodyTake,
    possession: Possession,
    *,
    fit: bool = True,
    ends: Float | None = None,
    joints: Float | None = None,
    nodes: int = 128,
    progress: Callable[[float], None] | None = None,
    notes: list[str] | None = None,
) -> tuple[Project, str]:
    """Adds a mesh that performers move in the same way as the mesh of a recorded possession. Returns the
    project and the mesh's id.

    The mesh is placed at its performers, as for a live performance. It keeps the ends and joints that were
    marked on it. Settings that refer to positions on the first mesh (ends, joints and stiff spots) are
    dropped.

    Args:
        fit: True to scale the mesh to a person's size first, False to keep its size.
        ends, joints: ends and joints of the mesh, as in :func:`enliven.possession.prepare_for_actor`.
        nodes, progress, notes: as in :func:`possess_mesh`.

    Raises:
        InputError: if the performers cannot attach to any point of the mesh.
    """
    settings = replace(settings_from_possession(possession), stiffness=(), ends=(), joints=())
    prepared_mesh = prepare_for_actor(mesh, settings, fit=fit, ends=ends, joints=joints)
    how = replace(
        possession,
        settings=json.dumps(asdict(prepared_mesh.settings)),
        place=(),
        height=prepared_mesh.height,
        size=prepared_mesh.size,
    )
    project, name = possess_mesh(
        project, prepared_mesh.mesh, take, how, nodes=nodes, progress=progress, notes=notes
    )
    landmarks = {key: np.reshape(getattr(prepared_mesh.settings, key), (-1, 3)) for key in ("ends", "joints")}
    return project.with_characters(project.graph(name).with_changes(**landmarks)), name
