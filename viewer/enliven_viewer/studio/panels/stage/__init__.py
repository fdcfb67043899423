"""The panels of the stage: workspaces, the Perform panel, and text over the view."""
