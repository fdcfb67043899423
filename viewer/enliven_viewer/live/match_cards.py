"""Match candidates as cards: a small picture of the skeleton with the driven bones in colour."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from enliven.arrays import Float
from enliven.matching.match_list import MatchList
from enliven_viewer.language import tr
from enliven_viewer.render.camera import CameraView
from enliven_viewer.render.overlay.match_lines import find_tints
from enliven_viewer.render.scene import Scene, SceneCharacter
from enliven_viewer.theme import ACCENT, FAINT, GLASS, INK, QUIET

if TYPE_CHECKING:
    from enliven_viewer.render.overlay.canvas import Pen

CARD_WIDTH_PX = 124.0
"""Width of a card in pixels on a standard screen: nine cards fit into 1280 pixels."""
CARD_HEIGHT_PX = 92.0
"""Height of a card in pixels: a title line, the picture and a score line."""
CARD_GAP_PX = 8.0
"""Gap between two cards in pixels."""
CARD_PADDING_PX = 10.0
"""Distance in pixels between the border of a card and its text."""
PICTURE_ASPECT = 2.0
"""Aspect ratio of the picture on a card."""


@dataclass(frozen=True, eq=False)
class MatchCard:
    """One match, ready to be drawn.

    Attributes:
        title: rank of the match, after the character's name if several characters choose.
        score: name of the match with its start and similarity.
        meant: True if this match would be accepted.
        bones: (E, 2, 2) line segments of the whole skeleton. x runs to the right from 0 to PICTURE_ASPECT, y
            runs down from 0 to 1.
        lines: for each branch of the source, a polyline (K, 2) in the same coordinates.
        held: elapsed fraction, 0..1, of the time for which the performer must hold still.
        row: index of its character among the characters with match candidates.
        tints: for each branch of the source, the colour that its limb has on the performer.
    """

    title: str
    score: str
    meant: bool
    bones: Float
    lines: tuple[Float, ...]
    held: float = 0.0
    row: int = 0
    tints: tuple[tuple[float, float, float], ...] = ()


def make_cards(scene: Scene, view: CameraView) -> tuple[MatchCard, ...]:
    """Returns the cards of each character with match candidates, as seen by the camera."""
    boards = [(actor, scene.boards.get(actor.character.id)) for actor in scene.actors]
    choosing = [(actor, board) for actor, board in boards if board is not None and board.state == "choosing"]
    has_several = len(choosing) > 1
    card_rows = [
        _make_character_cards(actor, board, view, row, has_several)
        for row, (actor, board) in enumerate(choosing)
    ]
    return tuple(card for cards in card_rows for card in cards)


def _make_character_cards(
    actor: SceneCharacter, board: MatchList, view: CameraView, number_of_row: int, several: bool
) -> list[MatchCard]:
    bones = actor.pose.positions[actor.character.edges].astype(np.float64)
    pivots = [bones.reshape(-1, 3), *(line for row in board.rows for line in row.lines)]
    projected = view.project(np.concatenate(pivots)) * [1.0, -1.0]
    # Scale by the aspect ratio of the projection, because pixels on the card are square.
    projected[:, 0] *= view.clip_from_camera[1, 1] / view.clip_from_camera[0, 0]
    middle, reach = (
        (projected.max(0) + projected.min(0)) / 2,
        float((np.ptp(projected, axis=0) / [PICTURE_ASPECT, 1.0]).max()) or 1.0,
    )
    projected = np.array([PICTURE_ASPECT / 2, 0.5]) + (projected - middle) / reach
    ends = np.cumsum([0, *(len(points) for points in pivots)])
    parts = [projected[a:b] for a, b in itertools.pairwise(ends)]
    cards, part_start = [], 1
    for number, row in enumerate(board.rows):
        lines = tuple(parts[part_start : part_start + len(row.lines)])
        part_start += len(row.lines)
        title = f"{board.character[:8]} " * several + (
            tr("best match") if row.place == 0 else tr("match {0}", row.place + 1)
        )
        is_highlighted = number == board.shown
        score = row.name[:16]
        bones, held = parts[0].reshape(-1, 2, 2), board.held * is_highlighted
        cards.append(
            MatchCard(title, score, is_highlighted, bones, lines, held, number_of_row, find_tints(row))
        )
    return cards


def draw_cards(
    canvas: Pen, size: tuple[int, int], scale: float, text: int, cards: tuple[MatchCard, ...]
) -> None:
    """Draws a centred row of cards above the timeline for each character. Cards that do not fit are omitted.

    Args:
        size: width and height of the image in pixels.
        text: text size in pixels.
    """
    step = (CARD_WIDTH_PX + CARD_GAP_PX) * scale
    max_cards = max(int((size[0] - 32 * scale) // step), 0)
    for row, row_cards in itertools.groupby(cards, lambda card: card.row):
        shown_cards = list(row_cards)[:max_cards]
        left = (size[0] - step * len(shown_cards) + CARD_GAP_PX * scale) / 2
        top = size[1] - (CARD_HEIGHT_PX + 66 + row * (CARD_HEIGHT_PX + CARD_GAP_PX)) * scale
        for number, card in enumerate(shown_cards if top > 0 else ()):
            _draw_card(canvas, left + number * step, top, scale, text, card)


def _draw_card(canvas: Pen, x: float, y: float, s: float, text: int, card: MatchCard) -> None:
    width, height = CARD_WIDTH_PX * s, CARD_HEIGHT_PX * s
    if card.meant:
        canvas.rectangle(x - 2 * s, y - 2 * s, width + 4 * s, height + 4 * s, ACCENT, 11 * s)
        canvas.rectangle(x, y, width, height, (*GLASS[:3], 0.96), 9 * s)
    else:
        canvas.rectangle(x, y, width, height, GLASS, 9 * s)
    canvas.text(x + CARD_PADDING_PX * s, y + 5 * s, card.title, text, INK if card.meant else QUIET)
    canvas.text(x + CARD_PADDING_PX * s, y + height - 7 * s - text, card.score, text, QUIET)
    side = height - 2 * (text + 8 * s)
    corner = np.array([x + (width - PICTURE_ASPECT * side) / 2, y + text + 8 * s])
    for bone in corner + side * card.bones:
        canvas.line(bone, 1.2 * s, FAINT)
    limbs = zip(card.lines, card.tints, strict=True)
    for line, tint in ((line, tint) for line, tint in limbs if len(line)):
        # Only limbs that drive a branch of the character have a line.
        canvas.line(corner + side * line, 3.0 * s, (*tint, 1.0))
    if card.held > 0.0:
        canvas.rectangle(x + 8 * s, y + height - 5 * s, (width - 16 * s) * card.held, 3 * s, ACCENT, 1.5 * s)
