"""Sensors that receive motion from other programs: VMC bones, Rokoko actors and OSC trackers become
bodies.
"""
