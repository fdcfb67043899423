"""The table of all actions, with the shortcuts changed by the artist."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator

from enliven.errors import EnlivenError, InputError
from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.actions.keys import format_key
from enliven_viewer.studio.actions.search import rank_actions
from enliven_viewer.studio.preferences import Preferences
from enliven_viewer.studio.toasts import Toasts

_LAST_MENU = "Help"
_MAX_RECENT = 8
"""Maximum number of recent actions, which the palette lists first while its search text is empty."""


class ActionTable:
    """All actions: for menus, shortcuts and the command palette.

    Args:
        toasts: shows the reason why an action is unavailable, or its error.
        preferences: stores changed shortcuts.

    Attributes:
        recent: ids of the most recently run actions, newest first.
        workspace: returns the workspace with its own shortcuts, which take precedence; empty for none.
    """

    def __init__(self, toasts: Toasts, preferences: Preferences) -> None:
        self._toasts, self._preferences = toasts, preferences
        self._actions: dict[str, Action] = {}
        self.recent: list[str] = []
        self.workspace: Callable[[], str] = lambda: ""

    def add(self, *actions: Action, after: str = "") -> None:
        """Adds actions to their menus.

        Args:
            after: id of the action after which they are inserted in the menus and in the palette; empty for
                the end.

        Raises:
            InputError: if an id already exists, a shortcut is taken, or the action ``after`` does not exist.
        """
        if after and after not in self:
            remedy = tr("Pass the id of an existing action.")
            raise InputError(
                tr("the action {0} is unknown", after), where=f"action {actions[0].id}", remedy=remedy
            )
        for action in actions:
            rivals = [other for other in self if other.conflicts_with(action)]
            conflicts = [(key, other) for key in action.keys for other in rivals if key in other.keys]
            if action.id in self._actions or conflicts:
                problem = (
                    f"the shortcut {conflicts[0][0]} is already used by {conflicts[0][1].id}"
                    if conflicts
                    else "this action id exists already"
                )
                raise InputError(
                    problem, where=f"action {action.id}", remedy="Choose another id or shortcut."
                )
            self._actions[action.id] = action
        if after:
            added = {action.id: action for action in actions}
            ids = [action_id for action_id in self._actions if action_id not in added]
            place = ids.index(after) + 1
            order = [*ids[:place], *added, *ids[place:]]
            self._actions = {action_id: self._actions[action_id] for action_id in order}

    def __iter__(self) -> Iterator[Action]:
        return iter(self._actions.values())

    def __contains__(self, action_id: object) -> bool:
        return action_id in self._actions

    def __getitem__(self, action_id: str) -> Action:
        return self._actions[action_id]

    @property
    def menus(self) -> dict[str, list[Action]]:
        """Returns the actions of each menu, in the order of the menu bar. Help is last."""
        names = dict.fromkeys(action.menu for action in self)
        order = [name for name in names if name != _LAST_MENU] + [_LAST_MENU] * (_LAST_MENU in names)
        return {name: [action for action in self if action.menu == name] for name in order}

    def do(self, action_id: str) -> bool:
        """Runs an action, or shows the reason why it is unavailable. Returns True if it was run."""
        action = self._actions[action_id]
        first, _, rest = tr(action.why_not()).partition(". ")
        if first:
            self._toasts.show_message(first.removesuffix("."), rest)
            return False
        self.recent = [action_id, *(other for other in self.recent if other != action_id)][:_MAX_RECENT]
        try:
            action.do()
        except Exception as error:  # An internal error must not close the user's window.
            if not isinstance(error, EnlivenError) and os.environ.get("ENLIVEN_DEBUG"):
                raise
            self._toasts.show_any_error(error, tr("Save your work, and report this error."))
        return True

    def press(self, key: str, *, workspace_only: bool = False) -> bool:
        """Runs the action with a shortcut. Returns False if no action has this shortcut.

        Args:
            workspace_only: if True, consider only shortcuts of the current workspace, which take precedence
                over the active tool.
        """
        workspace = self.workspace() if workspace_only else ""
        action = self.find_by_shortcut(key, workspace) if workspace or not workspace_only else None
        if action is not None:
            self.do(action.id)
        return action is not None

    def find_shortcuts(self, action: Action) -> tuple[str, ...]:
        """Returns the shortcuts of an action: the artist's own, or the defaults."""
        return self._preferences.keys.get(action.id, action.keys)

    def format_shortcut(self, action: Action) -> str:
        """Returns the first shortcut of an action as displayed, or an empty text for an action without a
        shortcut.
        """
        return format_key(self.find_shortcuts(action)[0]) if self.find_shortcuts(action) else ""

    def find_by_shortcut(self, key: str, workspace: str = "") -> Action | None:
        """Returns the action with a shortcut in a workspace, or everywhere if ``workspace`` is empty."""
        with_key = (action for action in self if key in self.find_shortcuts(action))
        return next(
            (
                action
                for action in with_key
                if (workspace in action.workspaces if workspace else not action.workspaces)
            ),
            None,
        )

    def find_conflict(self, action_id: str, key: str) -> Action | None:
        """Returns another action with the same shortcut that would conflict with this action."""
        wanted_action = self._actions[action_id]
        others = (
            action for action in self if action is not wanted_action and action.conflicts_with(wanted_action)
        )
        return next((action for action in others if key in self.find_shortcuts(action)), None)

    def set_shortcut(self, action_id: str, key: str) -> None:
        """Sets the shortcut of an action in place of its current ones, and removes it from other actions."""
        while (other := self.find_conflict(action_id, key)) is not None:
            self._preferences.keys[other.id] = tuple(
                other_key for other_key in self.find_shortcuts(other) if other_key != key
            )
        self._preferences.keys[action_id] = (key,)
        self._save_changes()

    def clear_shortcuts(self, action_id: str) -> None:
        """Removes all shortcuts of an action."""
        self._preferences.keys[action_id] = ()
        self._save_changes()

    def reset_shortcuts(self) -> None:
        """Restores the default shortcuts of all actions."""
        self._preferences.keys.clear()
        self._preferences.save()

    @property
    def has_custom_shortcuts(self) -> bool:
        """Returns True if an action has shortcuts other than its defaults."""
        return bool(self._preferences.keys)

    def find(self, typed: str) -> list[Action]:
        """Returns the matching actions, best match first. Without text, recent actions come first."""
        if typed.strip():
            return rank_actions(typed, self)
        first = [self._actions[action_id] for action_id in self.recent if action_id in self._actions]
        return [*first, *(action for action in self if action not in first)]

    def make_tooltip(self, action: Action) -> str:
        """Returns the tooltip of an action: its effect, its shortcut, and why it is unavailable."""
        key = self.format_shortcut(action)
        label = tr(action.label)
        first = f"{label}  ({key})" if key else label
        return "\n".join(tr(line) for line in (first, action.about, action.why_not()) if line)

    def _save_changes(self) -> None:
        """Removes shortcuts that equal the defaults, and saves the rest."""
        changed = self._preferences.keys
        for action_id in [
            action_id
            for action_id in changed
            if action_id in self._actions and changed[action_id] == self._actions[action_id].keys
        ]:
            del changed[action_id]
        self._preferences.save()
