from .action import Action as Action
from .palette_search import PaletteSearch as PaletteSearch
from .imgui_keys import KEYS as KEYS, held_keys as held_keys
from .keys import key_label as key_label
from .table import ActionTable as ActionTable
from .shortcut_capture import ShortcutCapture as ShortcutCapture
