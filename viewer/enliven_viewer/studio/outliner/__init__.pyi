from .actions import (
    single_shape_action as single_shape_action,
    choosing_actions as choosing_actions,
    outliner_actions as outliner_actions,
)
from .outliner import Outliner as Outliner
from .tree import (
    CHARACTER as CHARACTER,
    GROUP as GROUP,
    HANDLE as HANDLE,
    LIVE as LIVE,
    TAKE as TAKE,
    Row as Row,
)
