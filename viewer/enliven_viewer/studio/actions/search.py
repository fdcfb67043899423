"""Fuzzy search for an action by name."""

from __future__ import annotations

from collections.abc import Iterable

from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action

_WORD_START_SCORE = 8.0
"""Score of a letter at the start of a word, since people type initials."""
_CONSECUTIVE_SCORE = 6.0
"""Score of a letter that directly follows the previous match, since people type parts of words."""
_UNTYPED_PENALTY = 0.1
"""Penalty per letter of the name that was not typed, so that shorter names come first."""
_OTHER_TEXT_PENALTY = 50.0
"""Penalty if the letters match only together with the menu's name or the description."""


def likeness(typed: str, name: str) -> float | None:
    """Returns how well typed letters match a name; larger is better.

    None if the name does not contain them in order.
    """
    wanted, text = typed.lower().replace(" ", ""), name.lower()
    if not wanted:
        return 0.0
    best: list[tuple[float, int]] = [(0.0, -1)]
    for letter in wanted:
        matches = [
            (
                max(
                    score + (_CONSECUTIVE_SCORE if at == before + 1 else 0.0)
                    for score, before in best
                    if before < at
                ),
                at,
            )
            for at, text_letter in enumerate(text)
            if text_letter == letter and any(before < at for _, before in best)
        ]
        best = [
            (score + (_WORD_START_SCORE if at == 0 or not text[at - 1].isalnum() else 0.0), at)
            for score, at in matches
        ]
    return max((score for score, _ in best), default=0.0) - _UNTYPED_PENALTY * len(text) if best else None


def _likest(typed: str, *texts: str) -> float | None:
    """Returns the best :func:`likeness` to any of several texts.

    Letters must match within one text, so languages are not mixed.
    """
    return max((score for text in {*texts} if (score := likeness(typed, text)) is not None), default=None)


def rank_actions(typed: str, actions: Iterable[Action]) -> list[Action]:
    """Returns the matching actions, best match first. Without letters, returns all in their order."""
    scored = []
    for action in actions:
        label, about = tr(action.label), tr(action.about)
        plain = _likest(typed, action.label, label)
        wide = _likest(
            typed, f"{action.label} {action.menu} {action.about}", f"{label} {action.menu} {about}"
        )
        if plain is not None or wide is not None:
            scored.append((plain if plain is not None else (wide or 0.0) - _OTHER_TEXT_PENALTY, action))
    return (
        [action for _, action in sorted(scored, key=lambda pair: -pair[0])]
        if typed.strip()
        else [action for _, action in scored]
    )
