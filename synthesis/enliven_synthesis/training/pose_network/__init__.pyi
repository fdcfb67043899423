from .quantisation import quantise as quantise
from .weight_import import between as between, restored as restored
from .training import (
    KEPT_BACK as KEPT_BACK,
    RATE_OF_START as RATE_OF_START,
    TrainingSettings as TrainingSettings,
    export as export,
    measure as measure,
    train as train,
)
