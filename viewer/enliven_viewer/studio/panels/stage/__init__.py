"""The panels of the stage: workspaces, the Perform panel, text over the view, and the growing clip."""
