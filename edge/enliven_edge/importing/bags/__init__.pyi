from .orbbec import check_playback as check_playback
