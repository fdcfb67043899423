from .faults import (
    DAMAGE as DAMAGE,
    DECODE_ERRORS as DECODE_ERRORS,
    INVALID_NAME_REASON as INVALID_NAME_REASON,
    explain_write_errors as explain_write_errors,
    file_fault as file_fault,
    is_file_fault as is_file_fault,
)
from .reading import (
    MAX_FILE_BYTES as MAX_FILE_BYTES,
    decode_text as decode_text,
    is_file as is_file,
    open_file as open_file,
    read_file as read_file,
    text_bytes as text_bytes,
)
from .references import ReferencedFiles as ReferencedFiles, record_references as record_references
from .temporary_folder import TemporaryFolder as TemporaryFolder, remove_dead_folders as remove_dead_folders
from .user_folders import config_folder as config_folder, user_data_folder as user_data_folder
from .writing import (
    PART_SUFFIX as PART_SUFFIX,
    replace_file as replace_file,
    replace_folder as replace_folder,
    require_folder as require_folder,
    write_file as write_file,
    write_picture as write_picture,
)
