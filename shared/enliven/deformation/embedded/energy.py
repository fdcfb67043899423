"""The energy of KinÊtre's embedded deformation (eq. 3-8), and its gradient.

The unknowns are x (N, 4, 4), flattened. x[j, c, :3] is column c of R_j for c < 3, and x[j, 3, :3] is the
deformed position of node j, g_j + t_j. The fourth lane of each is 0, so that a column fills one vector
register (:mod:`enliven.lanes`). In these unknowns, the residuals of E_reg and E_con are linear, and the same
for each coordinate. The residuals of E_rot and E_rig are quadratic.
"""

from __future__ import annotations

from typing import NamedTuple

from enliven.arrays import Bool, Float, Int32
from enliven.kernels import njit
from enliven.lanes import fma4, load4, splat4, store4, total4


class SolverPlanes(NamedTuple):
    """Soft planes in the solver's format; see ``PlaneConstraints``.

    Attributes:
        nodes: (M, 4) int32 the nodes that move each point, by ascending elimination order.
        rows: (M, 4, 4) the coefficients, as in :class:`EnergyTerms`.
        normals: (M, 4) unit normals and a 0.
        offsets: (M,) metres, the offsets of the planes from the origin.
        weights: (M,) the weights of the planes, multiplied by the solver's own weight.
        one_sided: (M,) True if a plane only pushes.
    """

    nodes: Int32
    rows: Float
    normals: Float
    offsets: Float
    weights: Float
    one_sided: Bool


class EnergyTerms(NamedTuple):
    """The constants of the energy.

    Attributes:
        edges: (E, 2) int32 the nodes i, j of each edge.
        offsets: (E, 3) metres, the vectors g_j - g_i at rest.
        rigid: (K,) int32 the edges of E_rig.
        turning: 1.0 compares the translations of E_rig at the middle of the edge, which gives zero for any
            rigid motion. 0.0 uses eq. 7 as printed, |t_k - t_j|^2.
        nodes: (L, 4) int32 the nodes of each constraint, ascending. Nodes with weight 0 are skipped.
        rows: (L, 4, 4) the constraint's coefficients: w (p - g) and w for each of its nodes.
        held_start: (N + 1,) int32 the index at which the constraints of each node start. A constraint belongs
            to each node that has a weight in it.
        held_by: (H,) int32 the constraints, sorted by node.
        arms: (4 H,) the coefficients of each constraint on the node, copied from ``rows``.
        forces: (4 L,) scratch space for the derivative by each phi(p).
        targets: (L, 4) q_l and a 0.
        pulls: (L,) w_con times the weight of each constraint, or 0 if its target is lost.
        stretch: (N,) w_rot of each node.
        smooth: (E,) w_reg of each edge.
        hanging: (K,) w_rig of each rigid edge.
    """

    edges: Int32
    offsets: Float
    rigid: Int32
    turning: float
    nodes: Int32
    rows: Float
    held_start: Int32
    held_by: Int32
    arms: Float
    forces: Float
    targets: Float
    pulls: Float
    stretch: Float
    smooth: Float
    hanging: Float


@njit(cache=True, nogil=True)
def compute_energy_gradient(x, t, planes, out):
    """Computes dE/dx into ``out`` (16 N,). Returns the weighted E_rot, E_reg, E_con, E_rig, E_planes and
    their sum."""
    rot = _rotation_energy(x, t.stretch, out)
    reg = _smoothness_energy(x, t.edges, t.offsets, t.smooth, out)
    con = _constraint_energy(x, t, out)
    rig = _rigidity_energy(x, t, out) if t.rigid.shape[0] > 0 else 0.0
    side = _plane_energy(x, planes, out)
    return rot, reg, con, rig, side, rot + reg + con + rig + side


@njit(cache=True, nogil=True)
def _rotation_energy(x, w, out):
    """Computes E_rot, eq. 3: |RᵀR - I|^2. Overwrites ``out`` with its derivative dE/dR = 4 R (RᵀR - I)."""
    energy = 0.0
    zero = splat4(0.0)
    for j in range(w.shape[0]):
        at = 16 * j
        a, b, c = load4(x, at), load4(x, at + 4), load4(x, at + 8)
        aa, bb, cc = total4(a * a) - 1.0, total4(b * b) - 1.0, total4(c * c) - 1.0
        ab, bc, ca = total4(a * b), total4(b * c), total4(c * a)
        energy += w[j] * (aa * aa + bb * bb + cc * cc + 2 * (ab * ab + bc * bc + ca * ca))
        k = 4 * w[j]
        store4(out, at, fma4(k * aa, a, fma4(k * ab, b, fma4(k * ca, c, zero))))
        store4(out, at + 4, fma4(k * ab, a, fma4(k * bb, b, fma4(k * bc, c, zero))))
        store4(out, at + 8, fma4(k * ca, a, fma4(k * bc, b, fma4(k * cc, c, zero))))
        store4(out, at + 12, zero)
    return energy


@njit(cache=True, nogil=True)
def _smoothness_energy(x, edges, offsets, w, out):
    """Adds E_reg, eq. 4, in both directions of every edge: |R_i (g_j - g_i) + p_i - p_j|^2."""
    energy = splat4(0.0)
    for e in range(edges.shape[0]):
        i, j = 16 * edges[e, 0], 16 * edges[e, 1]
        a, b, c = offsets[e, 0], offsets[e, 1], offsets[e, 2]
        apart = load4(x, i + 12) - load4(x, j + 12)
        forth = fma4(a, load4(x, i), fma4(b, load4(x, i + 4), fma4(c, load4(x, i + 8), apart)))
        # The residual of the opposite direction is computed with a flipped sign, which does not change its
        # square.
        back = fma4(a, load4(x, j), fma4(b, load4(x, j + 4), fma4(c, load4(x, j + 8), apart)))
        energy = fma4(w[e], forth * forth + back * back, energy)
        k = splat4(2 * w[e])
        forth, back = k * forth, k * back
        store4(out, i, fma4(a, forth, load4(out, i)))
        store4(out, i + 4, fma4(b, forth, load4(out, i + 4)))
        store4(out, i + 8, fma4(c, forth, load4(out, i + 8)))
        store4(out, j, fma4(a, back, load4(out, j)))
        store4(out, j + 4, fma4(b, back, load4(out, j + 4)))
        store4(out, j + 8, fma4(c, back, load4(out, j + 8)))
        both = forth + back
        store4(out, i + 12, load4(out, i + 12) + both)
        store4(out, j + 12, load4(out, j + 12) - both)
    return total4(energy)


@njit(cache=True, nogil=True)
def _deformed_point(x, nodes, rows, m):
    """Returns the deformed position phi(p) (eq. 2) of point ``m`` as a vector (x, y, z, 0), in metres."""
    even = odd = splat4(0.0)
    for k in range(4):
        at = 16 * nodes[m, k]
        if rows[m, k, 3] != 0.0:
            even = fma4(rows[m, k, 0], load4(x, at), even)
            odd = fma4(rows[m, k, 1], load4(x, at + 4), odd)
            even = fma4(rows[m, k, 2], load4(x, at + 8), even)
            odd = fma4(rows[m, k, 3], load4(x, at + 12), odd)
    return even + odd


@njit(cache=True, nogil=True)
def _add_point_gradient(nodes, rows, m, force, out):
    """Adds ``force``, the derivative by phi(p), to the gradient of the nodes of point ``m``."""
    for k in range(4):
        at = 16 * nodes[m, k]
        if rows[m, k, 3] != 0.0:
            for c in range(4):
                store4(out, at + 4 * c, fma4(rows[m, k, c], force, load4(out, at + 4 * c)))


@njit(cache=True, nogil=True)
def _constraint_energy(x, t, out):
    """Adds E_con, eq. 5: |phi(p) - q|^2, times the constraint's own weight.

    Each node collects the forces of all its constraints. So its gradient is read and written once, not once
    per constraint.
    """
    energy = splat4(0.0)
    flat = t.targets.reshape(-1)
    for m in range(t.pulls.shape[0]):
        force = splat4(0.0)
        if t.pulls[m] > 0.0:
            off = _deformed_point(x, t.nodes, t.rows, m) - load4(flat, 4 * m)
            force = splat4(2 * t.pulls[m]) * off
            energy = fma4(t.pulls[m], off * off, energy)
        store4(t.forces, 4 * m, force)
    for j in range(t.stretch.shape[0]):
        first, last, at = t.held_start[j], t.held_start[j + 1], 16 * j
        if first == last:
            continue
        a, b, c, d = load4(out, at), load4(out, at + 4), load4(out, at + 8), load4(out, at + 12)
        for k in range(first, last):
            force = load4(t.forces, 4 * t.held_by[k])
            a, b = fma4(t.arms[4 * k], force, a), fma4(t.arms[4 * k + 1], force, b)
            c, d = fma4(t.arms[4 * k + 2], force, c), fma4(t.arms[4 * k + 3], force, d)
        store4(out, at, a)
        store4(out, at + 4, b)
        store4(out, at + 8, c)
        store4(out, at + 12, d)
    return total4(energy)


@njit(cache=True, nogil=True)
def constraint_energy(x, t):
    """Returns only E_con, weighted. If the nodes do not move, new targets change no other term."""
    energy = splat4(0.0)
    flat = t.targets.reshape(-1)
    for m in range(t.nodes.shape[0]):
        if t.pulls[m] > 0.0:
            off = _deformed_point(x, t.nodes, t.rows, m) - load4(flat, 4 * m)
            energy = fma4(t.pulls[m], off * off, energy)
    return total4(energy)


@njit(cache=True, nogil=True)
def _plane_energy(x, planes, out):
    """Adds w (n.phi(p) - b)^2 for each plane. A one-sided plane is skipped if n.phi(p) >= b."""
    energy = 0.0
    flat = planes.normals.reshape(-1)
    for m in range(planes.nodes.shape[0]):
        w = planes.weights[m]
        normal = load4(flat, 4 * m)
        gap = total4(normal * _deformed_point(x, planes.nodes, planes.rows, m)) - planes.offsets[m]
        if w > 0.0 and (gap < 0.0 or not planes.one_sided[m]):
            energy += w * gap * gap
            _add_point_gradient(planes.nodes, planes.rows, m, splat4(2 * w * gap) * normal, out)
    return energy


@njit(cache=True, nogil=True)
def _rigidity_energy(x, t, out):
    """Adds E_rig, eq. 7: |R_kᵀR_j - I|^2, and the squared difference of the translations."""
    energy = 0.0
    for m in range(t.rigid.shape[0]):
        e, w = t.rigid[m], t.hanging[m]
        j, k = 16 * t.edges[e, 0], 16 * t.edges[e, 1]
        for c in range(3):
            for d in range(3):
                left, right = load4(x, k + 4 * c), load4(x, j + 4 * d)
                s = total4(left * right) - (1.0 if c == d else 0.0)
                energy += w * s * s
                store4(out, k + 4 * c, fma4(2 * w * s, right, load4(out, k + 4 * c)))
                store4(out, j + 4 * d, fma4(2 * w * s, left, load4(out, j + 4 * d)))
        energy += _slip_energy(x, t.offsets[e], t.turning, w, j, k, out)
    return energy


@njit(cache=True, nogil=True)
def _slip_energy(x, offset, turning, w, j, k, out):
    """Adds the squared distance between the two images of the edge's middle (``turning`` 1), or between the
    two translations (``turning`` 0).
    """
    energy = 0.0
    for a in range(3):
        r = x[j + 12 + a] - x[k + 12 + a] + (1 - turning) * offset[a]
        for c in range(3):
            r += 0.5 * turning * offset[c] * (x[j + 4 * c + a] + x[k + 4 * c + a])
        energy += w * r * r
        out[j + 12 + a] += 2 * w * r
        out[k + 12 + a] -= 2 * w * r
        for c in range(3):
            out[j + 4 * c + a] += w * r * turning * offset[c]
            out[k + 4 * c + a] += w * r * turning * offset[c]
    return energy
