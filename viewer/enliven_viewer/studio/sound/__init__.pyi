from .actions import sound_actions as sound_actions
from .loudness import envelope as envelope
from .player import SoundPlayer as SoundPlayer
from .sound_reader import SOUNDS as SOUNDS, read_sound as read_sound
