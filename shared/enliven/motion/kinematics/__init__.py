"""Compiled kinematics: quaternions, vectors, and inverse kinematics of limbs and chains."""
