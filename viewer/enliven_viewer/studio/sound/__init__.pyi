from .actions import make_sound_actions as make_sound_actions
from .loudness import compute_envelope as compute_envelope
from .player import SoundPlayer as SoundPlayer
from .sound_reader import SOUND_SUFFIXES as SOUND_SUFFIXES, read_sound as read_sound
