"""Tolerances for comparing two computations of the same value in a different order of operations.

A sum over a part, over the whole, in another thread or by another library is added in another order, and each
processor's instructions have their own order. Bit-exact equality is required only of copied or packed data,
or of results of the same code on the same shapes.
"""

from typing import Any

import numpy as np

ROUNDING_TOLERANCE = {np.dtype(np.float32): 2e-6, np.dtype(np.float64): 1e-12}
"""Maximum difference, relative to the largest number, after a few hundred terms. It is about twenty units in
the last place for float32 and ten thousand for float64. Products of long rows differed by 5e-9 in float32."""
SOLVER_TOLERANCE = 1e3
"""Factor on :data:`ROUNDING_TOLERANCE` for solutions of linear systems: the condition number amplifies
rounding.
"""


def assert_alike(made: Any, wanted: Any, times: float = 1.0) -> None:
    """Asserts equal shapes, and no difference larger than rounding errors; integers must be equal."""
    made, wanted = np.asarray(made), np.asarray(wanted)
    assert made.shape == wanted.shape
    kinds = [ROUNDING_TOLERANCE[a.dtype] for a in (made, wanted) if a.dtype in ROUNDING_TOLERANCE]
    largest = np.abs(wanted[np.isfinite(wanted)]).max(initial=0.0)
    np.testing.assert_allclose(made, wanted, rtol=0, atol=times * max(kinds, default=0.0) * float(largest))


def are_alike(made: Any, wanted: Any, times: float = 1.0) -> bool:
    """Returns True if :func:`assert_alike` would pass."""
    try:
        assert_alike(made, wanted, times)
    except AssertionError:
        return False
    return True
