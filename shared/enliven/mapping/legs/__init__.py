"""Legs in retargeted motion: stepping, planted feet, and forelegs above the floor.

:func:`enliven.mapping.legs.steps.apply_steps` is the entry. :mod:`gait` assigns the performer's legs to the
model's legs. :mod:`planting`, :mod:`planted_legs` and :mod:`planted_steps` keep standing feet still, and
:mod:`sole` measures how a foot rolls. :mod:`forelegs` and :mod:`trunk` keep the rest of the body above the
floor.
"""
