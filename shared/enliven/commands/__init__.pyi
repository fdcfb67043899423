from .lazy import LazyCommands as LazyCommands
from .processes import parent_is_gone as parent_is_gone, terminate_as_interrupt as terminate_as_interrupt
