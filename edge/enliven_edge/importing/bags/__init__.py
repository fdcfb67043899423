"""Readers of the recordings that the makers' own tools write: ROS bags of RealSense and Orbbec."""
