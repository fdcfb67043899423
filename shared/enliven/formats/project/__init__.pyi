from .file import read_project as read_project, write_project as write_project
