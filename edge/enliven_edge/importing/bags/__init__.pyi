from .orbbec import check_playback

__all__ = ["check_playback"]
