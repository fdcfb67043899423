"""Readers of the recordings that the makers' own tools write: ROS bags of RealSense and Orbbec."""

from enliven_edge.importing.bags.orbbec import check_playback

__all__ = ["check_playback"]
