"""Fuzzy search for an action by name."""

from __future__ import annotations

from collections.abc import Iterable

from enliven_viewer.language import tr
from enliven_viewer.studio.actions.action import Action

_WORD_START_SCORE = 8.0
"""Score of a letter at the start of a word, since people type initials."""
_CONSECUTIVE_SCORE = 7.5
"""Score of a letter that directly follows the previous match, since people type parts of words. It is nearly
the score of a word's start, so that "pup" finds a puppet before "parts: upper".
"""
_UNTYPED_PENALTY = 0.1
"""Penalty for each untyped letter of the name, so that shorter names come first."""
_OTHER_TEXT_PENALTY = 50.0
"""Penalty if the letters match only together with the menu's name or the description."""


def score_match(typed: str, name: str) -> float | None:
    """Returns a score of how well typed letters match a name. Larger is better. Returns None if the name does
    not contain the letters in order.
    """
    typed_letters, text = typed.lower().replace(" ", ""), name.lower()
    if not typed_letters:
        return 0.0
    best: list[tuple[float, int]] = [(0.0, -1)]
    for letter in typed_letters:
        matches = [
            (
                max(
                    score + (_CONSECUTIVE_SCORE if position == last_position + 1 else 0.0)
                    for score, last_position in best
                    if last_position < position
                ),
                position,
            )
            for position, text_letter in enumerate(text)
            if text_letter == letter and any(last_position < position for _, last_position in best)
        ]
        best = [
            (
                score + (_WORD_START_SCORE if position == 0 or not text[position - 1].isalnum() else 0.0),
                position,
            )
            for score, position in matches
        ]
    return max((score for score, _ in best), default=0.0) - _UNTYPED_PENALTY * len(text) if best else None


def _find_best_score(typed: str, *texts: str) -> float | None:
    """Returns the highest :func:`score_match` among several texts, or None if no text matches. All letters
    must match within one text, so that languages are not mixed.
    """
    return max((score for text in {*texts} if (score := score_match(typed, text)) is not None), default=None)


def rank_actions(typed: str, actions: Iterable[Action]) -> list[Action]:
    """Returns the matching actions, best match first. Without letters, returns all in their order."""
    scored = []
    for action in actions:
        label, description = tr(action.label), tr(action.about)
        plain = _find_best_score(typed, action.label, label)
        width = _find_best_score(
            typed, f"{action.label} {action.menu} {action.about}", f"{label} {action.menu} {description}"
        )
        if plain is not None or width is not None:
            scored.append((plain if plain is not None else (width or 0.0) - _OTHER_TEXT_PENALTY, action))
    return (
        [action for _, action in sorted(scored, key=lambda pair: -pair[0])]
        if typed.strip()
        else [action for _, action in scored]
    )
