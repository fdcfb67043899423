from .mesh import fit_mesh as fit_mesh
from .session import Session as Session, read_session as read_session
from .tables import MeshTable as MeshTable, TakeTable as TakeTable
from .take import write_puppet_take as write_puppet_take
from .text import write_session as write_session
