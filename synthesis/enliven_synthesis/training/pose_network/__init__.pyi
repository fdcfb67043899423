from .quantisation import quantise
from .training import KEPT_BACK, TrainingSettings, export, measure, train

__all__ = ["KEPT_BACK", "TrainingSettings", "export", "measure", "quantise", "train"]
