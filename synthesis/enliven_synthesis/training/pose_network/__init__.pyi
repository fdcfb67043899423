from .quantisation import quantise as quantise
from .weight_import import interpolate_networks as interpolate_networks, restore_network as restore_network
from .training import (
    VALIDATION_SAMPLES as VALIDATION_SAMPLES,
    FINE_TUNING_RATE as FINE_TUNING_RATE,
    TrainingSettings as TrainingSettings,
    export as export,
    measure as measure,
    train as train,
)
