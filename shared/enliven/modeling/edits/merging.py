"""Two characters made one at a moment, of any rigs."""

from __future__ import annotations

from enliven.document import Project
from enliven.errors import InputError
from enliven.modeling.edits.rigs import rig_of
from enliven.modeling.mesh import SeamSettings

_SEAM = SeamSettings()


def merge_characters(
    project: Project,
    host_id: str,
    graft_id: str,
    time: float,
    *,
    node: int | str | None = None,
    at: float = 1.0,
    loose: bool = False,
    seam: SeamSettings = _SEAM,
    notes: list[str] | None = None,
) -> Project:
    """A project with one character put onto another where the two are at ``time``; they are one from then on.

    At ``time`` both stay where they are, and both go on moving.

    Args:
        node: what the graft rides on: a joint of the host, by number or name, or a node of its graph; None
            takes the nearest.
        at: where on the host's bone that ends at ``node``: 1 is its end.
        loose: where no union of the meshes can be made, put both shells into one mesh.
        seam: how the seam is smoothed.
        notes: takes sentences about how the meshes were united.

    Raises:
        InputError: for a character merged with itself, a node that is not there, or meshes without a union.
    """
    host, graft = project.character(host_id), project.character(graft_id)
    if host_id == graft_id:
        mend = "Copy it first."
        raise InputError("a character cannot be merged with itself", where=host.where, mend=mend)
    told = [] if notes is None else notes
    if host.kind != graft.kind:
        what = f"{graft.where} cannot be merged with {host.where}"
        raise InputError(what, where="merge", mend="Bake one of them first.")
    rig = rig_of(project.characters[host_id])
    return rig.merged(project, host_id, graft_id, time, node, at, loose, seam, told)
