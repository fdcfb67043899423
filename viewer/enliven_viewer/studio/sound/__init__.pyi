from .actions import sound_actions as sound_actions
from .mixing import envelope as envelope, mixed as mixed
from .player import SoundPlayer as SoundPlayer
from .reading import SOUNDS as SOUNDS, read_sound as read_sound
