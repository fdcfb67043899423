"""Contacts of feet with the floor: found by height and speed, and kept by inverse kinematics."""
