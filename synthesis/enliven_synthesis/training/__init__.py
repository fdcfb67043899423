"""The training of the pose estimator: data set, network, losses, quantisation."""

from enliven_synthesis.training import dataset, training
from enliven_synthesis.training.dataset import Album, render_album
from enliven_synthesis.training.quantisation import quantise
from enliven_synthesis.training.training import KEPT_BACK, TrainingSettings, export, measure, train

__all__ = [
    "KEPT_BACK",
    "Album",
    "TrainingSettings",
    "dataset",
    "export",
    "measure",
    "quantise",
    "render_album",
    "train",
    "training",
]
