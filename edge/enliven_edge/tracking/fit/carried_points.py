"""Points that frames carry: where they are, how the unknowns move them, and how residuals are doubted."""

from __future__ import annotations

from enliven.kernels import njit
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.fit.normal_equations import of_frame


@njit(cache=True, nogil=True)
def point_row(row, scale, frame, point, normal, local, body):  # type: ignore[no-untyped-def]
    """Adds scale * normal . d(point)/d(unknowns) to the row, for a point carried by a frame.

    Args:
        local: (3, 12) derivative of the point, in its frame, by the lengths.
        body: the frames of a posture; the row has no places for the lengths where they are frozen.
    """
    world, pivots, by_length, dof_frame = body.world, body.pivots, body.by_length, body.dof_frame
    for a in range(3):
        row[a] += scale * normal[a]
    for k in range(len(dof_frame)):
        if body.moves[frame, k] == 0:
            continue
        f, axis = dof_frame[k], body.dof_axis[k]
        ax, ay, az = world[f, 0, axis], world[f, 1, axis], world[f, 2, axis]
        x, y, z = point[0] - pivots[f, 0], point[1] - pivots[f, 1], point[2] - pivots[f, 2]
        row[3 + k] += scale * (
            normal[0] * (ay * z - az * y) + normal[1] * (az * x - ax * z) + normal[2] * (ax * y - ay * x)
        )
    if len(row) == model.DOFS:
        return
    nx, ny, nz = normal
    tx = nx * world[frame, 0, 0] + ny * world[frame, 1, 0] + nz * world[frame, 2, 0]
    ty = nx * world[frame, 0, 1] + ny * world[frame, 1, 1] + nz * world[frame, 2, 1]
    tz = nx * world[frame, 0, 2] + ny * world[frame, 1, 2] + nz * world[frame, 2, 2]
    for p in range(local.shape[1]):
        moved = nx * by_length[frame, 0, p] + ny * by_length[frame, 1, p] + nz * by_length[frame, 2, p]
        moved += tx * local[0, p] + ty * local[1, p] + tz * local[2, p]
        row[model.DOFS + p] += scale * moved


@njit(cache=True, nogil=True)
def robust(residual, width):  # type: ignore[no-untyped-def]
    """Geman-McClure: the energy r^2 / (1 + (r / width)^2) and its weight in iterated least squares."""
    ratio = residual / width
    w = 1.0 / (1.0 + ratio * ratio)
    return residual * residual * w, w * w


@njit(cache=True, nogil=True)
def carried(point, frame, local, lengths, body):  # type: ignore[no-untyped-def]
    """Writes the (3,) place of a point that a frame carries, linear in the lengths, into ``point``."""
    world, pivots = body.world, body.pivots
    for a in range(3):
        point[a] = pivots[frame, a]
    for b in range(3):
        offset = 0.0
        for p in range(len(lengths)):
            offset += local[b, p] * lengths[p]
        for a in range(3):
            point[a] += world[frame, a, b] * offset


@njit(cache=True, nogil=True)
def ends_by_length(out, body, capsule_frame, capsule_local):  # type: ignore[no-untyped-def]
    """(C, 2, 3, L) the derivatives of the capsules' ends by the lengths, world frame, into ``out``."""
    for c in range(len(capsule_frame)):
        for e in range(2):
            by_length(out[c, e], capsule_frame[c], capsule_local[c, e], body)


@njit(cache=True, nogil=True)
def by_length(out, frame, local, body):  # type: ignore[no-untyped-def]
    """(3, L) the derivatives by the lengths of a point that is (3, 12) in its frame, into ``out``."""
    world, of_pivot, lengths_of = body.world, body.by_length, body.lengths_of
    out[:] = 0.0
    for p in of_frame(lengths_of, frame, out.shape[1]):
        x, y, z = local[0, p], local[1, p], local[2, p]
        for a in range(3):
            out[a, p] = of_pivot[frame, a, p] + world[frame, a, 0] * x + world[frame, a, 1] * y
            out[a, p] += world[frame, a, 2] * z


@njit(cache=True, nogil=True)
def stretch_into(out, normal, by_ends, t, frame, lengths_of):  # type: ignore[no-untyped-def]
    """(L,) normal . d(point)/d(length), a share t along a capsule, into ``out``; not by the girth."""
    out[:] = 0.0
    for p in of_frame(lengths_of, frame, len(out)):
        for a in range(3):
            out[p] += normal[a] * ((1.0 - t) * by_ends[0, a, p] + t * by_ends[1, a, p])
