"""Recordings of the makers' own tools: ROS bags of RealSense and Orbbec."""
