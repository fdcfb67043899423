"""Motion over time in the studio: the curves of the selection, and ghosts and trails of its motion."""
