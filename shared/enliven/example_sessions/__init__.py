"""Sessions of example poses as text files: a mesh, its control points, key poses and takes."""

from enliven.example_sessions.mesh import fitted
from enliven.example_sessions.session import read_session
from enliven.example_sessions.tables import MeshTable, TakeTable
from enliven.example_sessions.take import write_puppet_take
from enliven.example_sessions.text import write_session

__all__ = ["MeshTable", "TakeTable", "fitted", "read_session", "write_puppet_take", "write_session"]
