"""The project file of enliven, written and read."""

from enliven.formats.project.file import read_project, write_project

__all__ = ["read_project", "write_project"]
