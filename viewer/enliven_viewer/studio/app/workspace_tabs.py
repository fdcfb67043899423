"""The workspaces of the window, and the choice between them."""

from __future__ import annotations

from dataclasses import dataclass

WORKSPACES = ("Perform", "Animate", "Model", "Play")
"""The workspaces, which differ in their panels. The loaded project stays the same."""
_TOOL_WORKSPACES = ("Animate", "Model")


def has_tools(workspace_name: str) -> bool:
    """Returns True if a workspace has tools."""
    return workspace_name in _TOOL_WORKSPACES


@dataclass
class WorkspaceTabs:
    """The choice of the workspace.

    Attributes:
        active: the current workspace, one of :data:`WORKSPACES`.
    """

    active: str = "Animate"
