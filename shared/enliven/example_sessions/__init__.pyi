from .mesh import fitted
from .session import read_session
from .tables import MeshTable, TakeTable
from .take import write_puppet_take
from .text import write_session

__all__ = ["MeshTable", "TakeTable", "fitted", "read_session", "write_puppet_take", "write_session"]
