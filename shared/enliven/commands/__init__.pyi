from .lazy import LazyCommands
from .processes import parent_is_gone, terminate_as_interrupt

__all__ = ["LazyCommands", "parent_is_gone", "terminate_as_interrupt"]
