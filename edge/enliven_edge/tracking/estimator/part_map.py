"""Samples the network's map of body parts at points, with bilinear interpolation, compiled.

The loops process one part after the other, so that the compiler can vectorise them.
"""

from __future__ import annotations

import numpy as np

from enliven.kernels import njit
from enliven_edge.tracking.estimator.crop import COLUMNS, cells_at

_MIN_EXPONENT = np.float32(-87.0)
"""Exponent below which e^x underflows in single precision."""
_LOG2_E = np.float32(1.0 / np.log(2.0))
"""log2(e), which converts the exponent of e into an exponent of 2."""
_LOG_2 = np.log(2.0)
_LOG_2_HIGH = np.float32(round(_LOG_2 * 512) / 512)
"""Upper bits of log(2). The product with a whole number below 2^14 is exact in single precision."""
_LOG_2_LOW = np.float32(_LOG_2 - round(_LOG_2 * 512) / 512)
_SERIES = tuple(np.float32(1.0 / n) for n in (720.0, 120.0, 24.0, 6.0, 2.0))
"""Coefficients of the series of e^x from the sixth down to the second power. They suffice for abs(x) up to
log(2) / 2."""
_EXPONENT_BIAS, _MANTISSA_BITS = np.int32(127), np.int32(23)
"""Exponent bias of single precision, and the number of mantissa bits below the exponent."""


@njit(cache=True, nogil=True)
def parts_at_rays(logits, rays, axes, centre, scale):
    """Returns (P, M) float32 probabilities of P parts at M rays.

    They are a softmax over bilinearly interpolated logits.

    Args:
        logits: (P, h, w) float32.
        rays: (M, 2) x/z and y/z.
        axes, centre, scale: from :attr:`Crop.place`; they map a ray to cells of the crop, see
            :meth:`Crop.cells`.
    """
    rows, columns = logits.shape[1:]
    places = np.empty(len(rays), np.int32)
    right, down = np.empty(len(rays), np.float32), np.empty(len(rays), np.float32)
    share, cells = columns / COLUMNS, cells_at(rays, axes, centre, scale)
    for i in range(len(rays)):
        u = min(columns - 1.001, max(0.0, cells[i, 0] * share + columns / 2 - 0.5))
        v = min(rows - 1.001, max(0.0, cells[i, 1] * share + rows / 2 - 0.5))
        places[i], right[i], down[i] = int(v) * columns + int(u), u - int(u), v - int(v)
    out = np.empty((len(logits), len(rays)), np.float32)
    flat = logits.reshape(len(logits), -1)
    for p in range(len(logits)):
        _interpolate(out[p], flat[p], places, right, down, columns)
    _softmax(out)
    return out


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _interpolate(out, row, places, right, down, columns):
    """Interpolates a map bilinearly at (M,) cells plus fractions to the right and down, into ``out``."""
    for i in range(len(out)):
        at = np.uintp(places[i])
        a, b = row[at], row[at + np.uintp(1)]
        c, d = row[at + np.uintp(columns)], row[at + np.uintp(columns + 1)]
        above, below = a + right[i] * (b - a), c + right[i] * (d - c)
        out[i] = above + down[i] * (below - above)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _softmax(logits):
    """Replaces (P, M) logits by the probabilities of each column, in place."""
    most, total = logits[0].copy(), np.zeros(logits.shape[1], np.float32)
    for p in range(1, len(logits)):
        row = logits[p]
        for i in range(len(most)):
            most[i] = max(most[i], row[i])
    for p in range(len(logits)):
        row = logits[p]
        for i in range(len(most)):
            row[i] = exponential(row[i] - most[i])
            total[i] += row[i]
    for i in range(len(total)):
        total[i] = np.float32(1.0) / total[i]
    for p in range(len(logits)):
        row = logits[p]
        for i in range(len(total)):
            row[i] *= total[i]


@njit(cache=True, nogil=True, inline="always")
def exponential(x):
    """Returns e^x of a float32 by its series, with a relative error of 3e-7, for x up to 87.

    Below -87 it returns e^-87. It contains no function call, so that the compiler can vectorise it.
    """
    x = max(x, _MIN_EXPONENT)
    doublings = np.float32(np.floor(x * _LOG2_E + np.float32(0.5)))
    rest = x - doublings * _LOG_2_HIGH - doublings * _LOG_2_LOW
    a, b, c, d, e = _SERIES
    series = np.float32(1.0) + rest * (
        np.float32(1.0) + rest * (e + rest * (d + rest * (c + rest * (b + rest * a))))
    )
    return series * np.int32((np.int32(doublings) + _EXPONENT_BIAS) << _MANTISSA_BITS).view(np.float32)
