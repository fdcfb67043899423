"""What of a performance's maps a glTF node cannot say."""

import numpy as np

from enliven.exporters.performance import stretches_of
from enliven.rotation import to_matrix


def lost(performance):
    """The largest part of a map that a turn and a scale along ``axes`` cannot express."""
    axes = np.eye(3) if performance.axes is None else performance.axes
    turns, scales = stretches_of(performance.linear @ axes)
    said = to_matrix(turns) * scales[..., None, :] @ np.swapaxes(axes, -1, -2)
    return float(np.abs(said - performance.linear).max())
