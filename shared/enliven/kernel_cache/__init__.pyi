from .cache import keep as keep
from .compiling import listen_to_compiler as listen_to_compiler
from .compiling import on_compilation as on_compilation
from .store import shipped_folders as shipped_folders
from .store import user_folder as user_folder
from .target import choose_target as choose_target
from .target import processor_levels as processor_levels
