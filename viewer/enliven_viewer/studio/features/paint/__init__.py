"""The brush that paints the stiffness of a mesh: its tool, actions and options."""
