"""The network itself: its layers in PyTorch, its training, and its quantisation for the edge."""

from enliven_synthesis.training.pose_network.quantisation import quantise
from enliven_synthesis.training.pose_network.training import (
    KEPT_BACK,
    TrainingSettings,
    export,
    measure,
    train,
)

__all__ = ["KEPT_BACK", "TrainingSettings", "export", "measure", "quantise", "train"]
