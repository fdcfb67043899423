"""Measures the part of a performance's linear maps that a glTF node cannot represent."""

import numpy as np

from enliven.exporters.performance import split_stretch
from enliven.rotation import to_matrix


def measure_lost_shear(performance):
    """Returns the magnitude of the largest shear: the part of a map that is neither a rotation nor a scale
    along ``axes``.
    """
    axes = np.eye(3) if performance.axes is None else performance.axes
    turns, scales = split_stretch(performance.linear @ axes)
    product = to_matrix(turns) * scales[..., None, :] @ np.swapaxes(axes, -1, -2)
    return float(np.abs(product - performance.linear).max())
