"""The brush that paints how stiff a mesh is: its tool, actions and options."""
