from .file import (
    project_bytes as project_bytes,
    project_of as project_of,
    read_project as read_project,
    refuse_later_project as refuse_later_project,
    write_project as write_project,
)
from .one_character import (
    character_bytes as character_bytes,
    project_of_mesh as project_of_mesh,
    texture_bytes as texture_bytes,
)
