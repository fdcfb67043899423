"""The commands that the library itself owns: run both programs, and say what a machine lacks."""

from enliven.commands.lazy import LazyCommands
from enliven.commands.processes import parent_is_gone, terminate_as_interrupt

__all__ = ["LazyCommands", "parent_is_gone", "terminate_as_interrupt"]
