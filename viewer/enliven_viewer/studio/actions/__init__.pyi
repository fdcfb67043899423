from .action import Action as Action
from .finding import Finding as Finding
from .imgui_keys import KEYS as KEYS, held_keys as held_keys
from .keys import spoken as spoken
from .table import ActionTable as ActionTable
from .wanted_key import WantedKey as WantedKey
