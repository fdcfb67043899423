from .file import read_project, write_project

__all__ = ["read_project", "write_project"]
