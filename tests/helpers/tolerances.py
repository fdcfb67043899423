"""How far apart two computations of one thing may be, where a processor may take them in another order.

A sum over a part, over the whole, in another thread or by another library is added up in another order, and
each processor's instructions have an order of their own. Bit for bit is asked only of what is copied, packed,
or computed twice by the same code on the same shapes.
"""

from typing import Any

import numpy as np

ROUNDING = {np.dtype(np.float32): 2e-6, np.dtype(np.float64): 1e-12}
"""Share of the largest number by which a few hundred terms may differ: some ten thousand and twenty units in
the last place, as products of long rows were seen to differ by 5e-9 in float32."""
SOLVED = 1e3
"""Times :data:`ROUNDING` for what comes out of a linear system: its condition number enlarges a rounding."""


def assert_alike(made: Any, wanted: Any, times: float = 1.0) -> None:
    """Both have one shape, and no entry is farther off than rounding explains; whole numbers are the same."""
    made, wanted = np.asarray(made), np.asarray(wanted)
    assert made.shape == wanted.shape
    kinds = [ROUNDING[a.dtype] for a in (made, wanted) if a.dtype in ROUNDING]
    largest = np.abs(wanted[np.isfinite(wanted)]).max(initial=0.0)
    np.testing.assert_allclose(made, wanted, rtol=0, atol=times * max(kinds, default=0.0) * float(largest))


def alike(made: Any, wanted: Any, times: float = 1.0) -> bool:
    """Whether :func:`assert_alike` holds."""
    try:
        assert_alike(made, wanted, times)
    except AssertionError:
        return False
    return True
