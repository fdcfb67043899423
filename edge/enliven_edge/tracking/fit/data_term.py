"""The data term of the fit, compiled: the distances between the body's surface and the observed points.

Consider a point on a capsule with the axis s + t d, outward normal n and parameter t. Its residual is r =
distance - radius. The residual decreases by n . dx if the axis moves by dx, and by dR if the radius R grows
by dR. The points of a capsule enter the normal equations only by the weighted moments

    sum t^k n n',  sum t^k n,  sum t^k  (k = 0, 1, 2)   and   sum r t^k n,  sum r t^k  (k = 0, 1):

This holds because the wrench (n, (s + t d) cross n) is linear in n and t n. The motion by a bone's length is
linear along the axis. So each point needs only a few products, and the rest is computed once per capsule.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven_edge.tracking.body_model import model
from enliven_edge.tracking.body_model.capsules import FAST, nearest_capsules
from enliven_edge.tracking.fit.normal_equations import lengths_of_frame


@njit(cache=True, nogil=True)
def depth_to_model(sums, seen, affinity, surface, weight, width, side, support):
    """Adds the distance of every observed point from the surface of its nearest capsule to the sums.

    ``support`` (C,) receives the number of points that each capsule explains within ``width``. Returns
    (energy, fraction of the points that are explained).

    Args:
        sums: as returned by :func:`normal_equations.empty_sums`.
        seen, affinity: in the form of :func:`capsules.nearest_capsules`.
        surface: a :class:`~enliven_edge.tracking.fit.structures.CapsuleSurface`.
        weight: the weight of the term.
        width: robust width in metres.
        side: see :func:`capsules.nearest_capsules`.
        support: (C,) receives point counts.
    """
    ends, radii, capsule_frame, tug = surface.ends, surface.radii, surface.frame, sums.tug
    many = max(1, seen.shape[1])
    which = np.empty(seen.shape[1], np.int32)
    nearest_capsules(which, seen, affinity, ends, radii, np.float32(side))
    points, first = _by_capsule(which, seen, len(ends))
    squares, firsts, powers = np.empty((3, 3, 3)), np.empty((5, 3)), np.empty(5)
    turned, moved_by = np.empty((2, 3, 3)), np.empty((2, max(1, len(tug)), 3))
    energy, explained = 0.0, 0.0
    for c in range(len(ends)):
        f, support[c] = capsule_frame[c], 0.0
        if first[c] == first[c + 1]:
            continue
        span, axis = (first[c], first[c + 1]), (ends[c], radii[c])
        cost, support[c] = _moments(squares, firsts, powers, points, span, axis, np.float32(width))
        energy, explained = energy + cost, explained + support[c]
        scale = weight / many
        squares *= scale
        firsts *= scale
        powers *= scale
        start = (ends[c, 0, 0], ends[c, 0, 1], ends[c, 0, 2])
        way = (ends[c, 1, 0] - start[0], ends[c, 1, 1] - start[1], ends[c, 1, 2] - start[2])
        _add_pose_terms(sums.total[f], sums.pull[f], squares, firsts, start, way, turned)
        if len(tug) > 0:
            growth = (radii[c, 0] / surface.girth, radii[c, 1] / surface.girth)
            along = (start, way, surface.by_ends[c], growth)
            moved = lengths_of_frame(surface.lengths_of, f, len(tug))
            _add_length_terms(sums.cross[f], sums.own, tug, squares, firsts, powers, along, moved, moved_by)
    return weight / many * energy, explained / many


@njit(cache=True, nogil=True)
def _by_capsule(which, seen, count):
    """Sorts the points by capsule (counting sort). Returns (3, M) points and the (C + 1,) index of each
    capsule's first point.
    """
    first = np.zeros(count + 1, np.int64)
    for c in which:
        first[c + 1] += 1
    for c in range(count):
        first[c + 1] += first[c]
    points, filled = np.empty((3, len(which)), np.float32), first.copy()
    for i in range(len(which)):
        c = which[i]
        for a in range(3):
            points[a, filled[c]] = seen[a, i]
        filled[c] += 1
    return points, first


@njit(cache=True, nogil=True, fastmath=FAST, error_model="numpy")
def _moments(squares, firsts, powers, points, span, axis, width):  # noqa: PLR0915, a kernel
    """Computes the moments of a capsule's points with robust weights.

    Returns (energy, points within ``width``).

    Most of a fit's time is spent here. So the sums are written out element by element in single precision,
    which the compiler can vectorise.

    Args:
        squares: (3, 3, 3) receives sum w t^k n n'.
        firsts: (5, 3) receives sum w t^k n for k = 0, 1, 2 and sum w r t^k n for k = 0, 1.
        powers: (5,) receives sum w t^k and sum w r t^k likewise.
        points: (3, M) float32, of all capsules. The compiler would not know that a slice of each row is
            contiguous.
        span: the first point of the capsule, and the end of its points.
        axis: (2, 3) and (2,) the capsule's ends and radii.
        width: float32 metres.
    """
    ends, radii = axis
    zero32, one32 = np.float32(0.0), np.float32(1.0)
    sx, sy, sz = np.float32(ends[0, 0]), np.float32(ends[0, 1]), np.float32(ends[0, 2])
    dx, dy, dz = np.float32(ends[1, 0]) - sx, np.float32(ends[1, 1]) - sy, np.float32(ends[1, 2]) - sz
    share = one32 / (dx * dx + dy * dy + dz * dz + np.float32(1e-12))
    start, growth = np.float32(radii[0]), np.float32(radii[1] - radii[0])
    xx0 = xy0 = xz0 = yy0 = yz0 = zz0 = xx1 = xy1 = xz1 = yy1 = yz1 = zz1 = zero32
    xx2 = xy2 = xz2 = yy2 = yz2 = zz2 = x0 = y0 = z0 = x1 = y1 = z1 = x2 = y2 = z2 = zero32
    rx0 = ry0 = rz0 = rx1 = ry1 = rz1 = w0 = w1 = w2 = r0 = r1 = energy = within = zero32
    for i in range(span[0], span[1]):
        # Compute the residual: the distance from the axis minus the radius at that point.
        a, b, c = points[0, i] - sx, points[1, i] - sy, points[2, i] - sz
        t = min(one32, max(zero32, (a * dx + b * dy + c * dz) * share))
        a, b, c = a - t * dx, b - t * dy, c - t * dz
        length = np.sqrt(a * a + b * b + c * c) + np.float32(1e-9)
        scale = one32 / length
        residual = length - start - t * growth
        # Compute the Geman-McClure energy and weight.
        ratio = residual / width
        falloff = one32 / (one32 + ratio * ratio)
        energy += residual * residual * falloff
        within += one32 if abs(residual) < width else zero32
        w = falloff * falloff
        a, b, c = a * scale, b * scale, c * scale
        # Add to the weighted sums.
        wt = w * t
        wtt, wr = wt * t, w * residual
        wrt = wr * t
        aa, ab, ac, bb, bc, cc = a * a, a * b, a * c, b * b, b * c, c * c
        xx0, xy0, xz0 = xx0 + w * aa, xy0 + w * ab, xz0 + w * ac
        yy0, yz0, zz0 = yy0 + w * bb, yz0 + w * bc, zz0 + w * cc
        xx1, xy1, xz1 = xx1 + wt * aa, xy1 + wt * ab, xz1 + wt * ac
        yy1, yz1, zz1 = yy1 + wt * bb, yz1 + wt * bc, zz1 + wt * cc
        xx2, xy2, xz2 = xx2 + wtt * aa, xy2 + wtt * ab, xz2 + wtt * ac
        yy2, yz2, zz2 = yy2 + wtt * bb, yz2 + wtt * bc, zz2 + wtt * cc
        x0, y0, z0, x1, y1, z1 = x0 + w * a, y0 + w * b, z0 + w * c, x1 + wt * a, y1 + wt * b, z1 + wt * c
        x2, y2, z2, w0, w1, w2 = x2 + wtt * a, y2 + wtt * b, z2 + wtt * c, w0 + w, w1 + wt, w2 + wtt
        rx0, ry0, rz0, r0 = rx0 + wr * a, ry0 + wr * b, rz0 + wr * c, r0 + wr
        rx1, ry1, rz1, r1 = rx1 + wrt * a, ry1 + wrt * b, rz1 + wrt * c, r1 + wrt
    _fill_square(squares[0], xx0, xy0, xz0, yy0, yz0, zz0)
    _fill_square(squares[1], xx1, xy1, xz1, yy1, yz1, zz1)
    _fill_square(squares[2], xx2, xy2, xz2, yy2, yz2, zz2)
    first_moments = ((x0, y0, z0), (x1, y1, z1), (x2, y2, z2), (rx0, ry0, rz0), (rx1, ry1, rz1))
    for k in range(5):
        for a in range(3):
            firsts[k, a] = first_moments[k][a]
    powers[0], powers[1], powers[2], powers[3], powers[4] = w0, w1, w2, r0, r1
    return energy, within


@njit(cache=True, nogil=True, inline="always")
def _fill_square(out, xx, xy, xz, yy, yz, zz):
    """Fills a symmetric (3, 3) matrix."""
    out[0, 0], out[0, 1], out[0, 2] = xx, xy, xz
    out[1, 0], out[1, 1], out[1, 2] = xy, yy, yz
    out[2, 0], out[2, 1], out[2, 2] = xz, yz, zz


@njit(cache=True, nogil=True, inline="always")
def _cross(a, x, y, z):
    """Returns (3,) a cross (x, y, z) as a tuple.

    A view of an array's row would be reference-counted, which is slower.
    """
    return a[1] * z - a[2] * y, a[2] * x - a[0] * z, a[0] * y - a[1] * x


@njit(cache=True, nogil=True)
def _add_pose_terms(total, pull, squares, firsts, start, way, room):
    """Adds a capsule's contribution to the normal equations: sum w phi phi' to ``total``, -sum w r phi to
    ``pull``.

    For each point, n, t and r are defined at the top of this module, and w is the robust weight. The
    derivative by a rigid motion is phi = (n, x cross n). Here x = start + t way is the foot of the point on
    the capsule's axis.

    ``room`` (2, 3, 3) is overwritten.
    """
    # Compute two vectors for each component a of n: u[a] = sum w n_a (x cross n), and v[a] = sum w t n_a (x
    # cross n). Together they give the block of x cross n with itself, because x = start + t way.
    u, v = room[0], room[1]
    for a in range(3):
        p, q, r = squares[1, a, 0], squares[1, a, 1], squares[1, a, 2]
        s0 = _cross(start, squares[0, a, 0], squares[0, a, 1], squares[0, a, 2])
        s1, d1 = _cross(start, p, q, r), _cross(way, p, q, r)
        d2 = _cross(way, squares[2, a, 0], squares[2, a, 1], squares[2, a, 2])
        for b in range(3):
            u[a, b], v[a, b] = s0[b] + d1[b], s1[b] + d2[b]
    for b in range(3):
        twice = _cross(start, u[0, b], u[1, b], u[2, b])
        more = _cross(way, v[0, b], v[1, b], v[2, b])
        for a in range(3):
            total[a, b] += squares[0, a, b]
            total[a, 3 + b] += u[a, b]
            total[3 + b, a] += u[a, b]
            total[3 + a, 3 + b] += twice[a] + more[a]
    about = _cross(start, firsts[3, 0], firsts[3, 1], firsts[3, 2])
    along = _cross(way, firsts[4, 0], firsts[4, 1], firsts[4, 2])
    for a in range(3):
        pull[a] -= firsts[3, a]
        pull[3 + a] -= about[a] + along[a]


@njit(cache=True, nogil=True)
def _add_length_terms(cross, own, tug, squares, firsts, powers, axis, lengths, room):
    """Adds the contribution of a capsule's points to the normal equations of the lengths.

    A length moves the axis by g + t h and makes the surface thicker by b + t e. The residual changes by the
    product of n with (g + t h), plus b + t e. For each length the kernel stores the sum of w n times this
    change, and the sum of w t n times this change.

    Args:
        cross, own, tug: the sums to extend, see :class:`~enliven_edge.tracking.fit.structures.FrameSums`.
        squares, firsts, powers: from :func:`_moments`, scaled by the weight.
        axis: start and way (3,), (2, 3, L) their ends' derivatives, (2,) the radii's derivatives by the
            girth.
        lengths: the lengths that move the capsule, the girth last.
        room: (2, L, 3) is overwritten.
    """
    start, way, by_ends, growth = axis
    count = len(lengths)
    here, beyond = room[0], room[1]
    for m in range(count):
        p = lengths[m]
        # Compute the gradient, and the sums ``here`` and ``beyond`` of this length.
        thick = growth[0] if p == model.GIRTH else 0.0
        more = growth[1] - growth[0] if p == model.GIRTH else 0.0
        tug[p] -= thick * powers[3] + more * powers[4]
        for a in range(3):
            here[m, a] = thick * firsts[0, a] + more * firsts[1, a]
            beyond[m, a] = thick * firsts[1, a] + more * firsts[2, a]
            g, h = by_ends[0, a, p], by_ends[1, a, p] - by_ends[0, a, p]
            tug[p] -= g * firsts[3, a] + h * firsts[4, a]
            for b in range(3):
                g, h = by_ends[0, b, p], by_ends[1, b, p] - by_ends[0, b, p]
                here[m, a] += squares[0, a, b] * g + squares[1, a, b] * h
                beyond[m, a] += squares[1, a, b] * g + squares[2, a, b] * h
        # Compute the block of this length with the pose.
        about = _cross(start, here[m, 0], here[m, 1], here[m, 2])
        along = _cross(way, beyond[m, 0], beyond[m, 1], beyond[m, 2])
        for a in range(3):
            cross[a, p] += here[m, a]
            cross[3 + a, p] += about[a] + along[a]
        # Compute the blocks of this length with the lengths up to it.
        for n in range(m + 1):
            q, value = lengths[n], 0.0
            for a in range(3):
                g, h = by_ends[0, a, q], by_ends[1, a, q] - by_ends[0, a, q]
                value += here[m, a] * g + beyond[m, a] * h
            if p == model.GIRTH and q == model.GIRTH:
                value += thick * (thick * powers[0] + 2 * more * powers[1]) + more * more * powers[2]
            own[q, p] += value
