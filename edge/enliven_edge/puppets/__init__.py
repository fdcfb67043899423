"""Puppets on the stage: performers move control points of any mesh by a few example poses."""
