from .quantisation import quantise as quantise
from .training import (
    KEPT_BACK as KEPT_BACK,
    TrainingSettings as TrainingSettings,
    export as export,
    measure as measure,
    train as train,
)
