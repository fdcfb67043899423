"""Retargeting in the studio: the tool that maps motion, the view of the take, and suggested matches."""
