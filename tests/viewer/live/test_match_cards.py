"""Tests of displaying matches: tubes on the model, cards, and the camera."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from swaying import swaying

from enliven.document.character import Character, SkinWeights
from enliven.matching.body_limbs import body_source, limb_number
from enliven.matching.match_list import MatchList, MatchRow
from enliven.person import BONES
from enliven.person.body import Body
from enliven.wire.matches import board_to_message, message_to_board
from enliven.wire.streams import MatchesMessage
from enliven_viewer.live.match_cards import draw_cards, make_cards
from enliven_viewer.live.view_report import ViewReporter, is_end_on, make_look, turn_to_bones
from enliven_viewer.playback.document import Document
from enliven_viewer.render.camera import OrbitCamera
from enliven_viewer.render.capsules import make_capsule_rows
from enliven_viewer.render.materials.paint import linear_from_srgb
from enliven_viewer.render.overlay.canvas import Canvas
from enliven_viewer.render.overlay.match_lines import find_limb_tints, make_match_rows
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import Scene, SceneCharacter, SceneStyle, make_scene
from enliven_viewer.theme import LIMB_COLOURS

PIVOTS = np.array([[0, 0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0], [0, 1.2, 0]], np.float32)
CHARACTER = Character(
    "cross",
    np.array([[0, 0.49, 0], [0.01, 0.5, 0], [0, 0.51, 0]], np.float32),
    np.array([[0, 1, 2]], np.int32),
    SkinWeights(np.zeros((3, 4), np.uint16), np.tile(np.array([1, 0, 0, 0], np.float32), (3, 1))),
    PIVOTS,
    np.array([[0, 1], [0, 2], [0, 3]], np.int32),
    "bones",
)
RIGHT, LEFT, UP = (PIVOTS[[0, k]].astype(float) for k in (1, 2, 3))
ROWS = (MatchRow("1-1", 0, 1.9, (RIGHT, LEFT)), MatchRow("1-1", 1, 1.2, (UP, LEFT)))
BOARD = MatchList("cross", "choosing", 1, 5, 0, ROWS, 3, 0.5)


def scene(board: MatchList = BOARD) -> Scene:
    return Scene(
        (SceneCharacter(CHARACTER, CHARACTER.rest_pose()),), (), SceneStyle(body=0.0), boards={"cross": board}
    )


def front() -> OrbitCamera:
    camera = OrbitCamera()
    camera.face(0.0, 0.05)
    camera.frame((np.array([-0.7, 0.0, -0.2]), np.array([0.7, 1.4, 0.2])), 1.5, at_once=True)
    return camera


def test_matched_chains_glow_in_the_limbs_colours(gl) -> None:
    renderer = Renderer(gl, (300, 200))
    view = front().view(1.5)
    plain = renderer
    plain.draw(replace(scene(), boards={}), view)
    without = plain.pixels().astype(int)
    renderer.draw(scene(), view)
    changed = np.abs(renderer.pixels().astype(int) - without).sum(-1)
    for line, tint in ((RIGHT, LIMB_COLOURS[0]), (LEFT, LIMB_COLOURS[1])):
        across, up = view.project(line.mean(0)[None])[0]
        column, row = int((across + 1) * 150), int((1 - up) * 100)
        pixel = renderer.pixels()[row, column].astype(float)
        assert changed[row, column] > 100
        assert int(pixel.argmax()) == int(np.argmax(tint)), (pixel, tint)
    across, up = view.project(UP.mean(0)[None])[0]
    assert changed[int((1 - up) * 100), int((across + 1) * 150)] < 30, "that would be another match"


def test_driven_limbs_are_thinner_and_have_no_cards() -> None:
    playing = replace(BOARD, state="playing", rows=ROWS[:1])
    (rows, deep), (thin, shallow) = make_match_rows({"cross": BOARD}), make_match_rows({"cross": playing})
    assert len(rows) == len(thin) == 2 * 3
    np.testing.assert_allclose(thin[:, 3], rows[:, 3] / 2)
    assert shallow == pytest.approx(deep / 2)
    assert make_cards(scene(playing), front().view(1.5)) == ()
    assert len(make_match_rows({"cross": MatchList("cross", "off")})[0]) == 0


def test_cards_show_each_match_as_it_is_seen() -> None:
    cards = make_cards(scene(), front().view(1.5))
    assert [card.title for card in cards] == ["best match", "match 2"]
    assert [card.meant for card in cards] == [True, False]
    assert [card.held for card in cards] == [0.5, 0.0]
    right, left = cards[0].lines
    assert right[1, 0] > right[0, 0] and left[1, 0] < left[0, 0], "right is right"
    assert cards[1].lines[0][1, 1] < cards[1].lines[0][0, 1], "up is up"
    spans = np.abs(cards[0].bones[:, 1] - cards[0].bones[:, 0]).max(1)
    np.testing.assert_allclose(spans / spans[0], [1.0, 1.0, 1.4], rtol=0.05, err_msg="nothing is stretched")


def test_each_character_that_chooses_has_its_row() -> None:
    other = replace(CHARACTER, id="spider")
    actors = tuple(SceneCharacter(character, character.rest_pose()) for character in (CHARACTER, other))
    both = {"cross": BOARD, "spider": replace(BOARD, character="spider", shown=1)}
    cards = make_cards(Scene(actors, (), SceneStyle(), boards=both), front().view(1.5))
    assert [(card.row, card.title) for card in cards] == [
        (0, "cross best match"),
        (0, "cross match 2"),
        (1, "spider best match"),
        (1, "spider match 2"),
    ]
    assert [card.meant for card in cards] == [True, False, False, True]


def test_cards_are_drawn_above_the_timeline_and_only_where_there_is_room(gl) -> None:
    texture = gl.texture((640, 360), 4)
    target = gl.framebuffer([texture])
    cards = make_cards(scene(), front().view(1.5))

    def ink(size: tuple[int, int]) -> np.ndarray:
        target.clear(0.2, 0.2, 0.2, 1)
        canvas = Canvas(gl)
        with canvas.draw_over(target):
            draw_cards(canvas, size, 1.0, 14, cards)
        picture = np.frombuffer(target.read(components=3, alignment=1), np.uint8).reshape(360, 640, 3)[::-1]
        return np.abs(picture.astype(int) - 51).sum(-1) > 12

    both, narrow = ink((640, 360)), ink((200, 360))
    rows, columns = np.nonzero(both)
    assert rows.min() > 180 and rows.max() < 360 - 54
    assert abs((columns.min() + columns.max()) / 2 - 320) < 4
    assert 0 < narrow.sum() < 0.7 * both.sum()
    assert not ink((100, 360)).any()
    bare = replace(BOARD, rows=tuple(replace(row, lines=(row.lines[0], RIGHT[:0])) for row in ROWS))
    cards = make_cards(scene(bare), front().view(1.5))
    assert 0 < ink((640, 360)).sum() < both.sum(), "a limb that would drive nothing has no line"


def test_a_line_of_the_canvas_covers_its_pixels_and_no_others(gl) -> None:
    texture = gl.texture((64, 64), 4)
    target = gl.framebuffer([texture])
    target.clear(0, 0, 0, 1)
    canvas = Canvas(gl)
    with canvas.draw_over(target):
        canvas.line(np.array([[10.0, 12.0], [40.0, 52.0]]), 6.0, (1, 1, 1, 1))
        canvas.line(np.array([[56.0, 8.0], [56.0, 8.0]]), 8.0, (1, 1, 1, 1))
    picture = np.frombuffer(target.read(components=3, alignment=1), np.uint8).reshape(64, 64, 3)[::-1, :, 0]
    y, x = np.mgrid[0:64, 0:64] + 0.5
    along = np.clip(((x - 10) * 30 + (y - 12) * 40) / 2500, 0, 1)
    far = np.hypot(x - 10 - 30 * along, y - 12 - 40 * along)
    dot = np.hypot(x - 56, y - 8)
    assert (picture[(far < 2.2) | (dot < 3.2)] > 200).all()
    assert (picture[(far > 4.0) & (dot > 5.0)] == 0).all()


def test_boards_come_to_the_scene_at_their_time_and_stay_while_the_next_is_under_way() -> None:
    document = Document(characters={"cross": CHARACTER})
    document.add_bodies(5, ())
    document.add_board(BOARD)
    document.add_bodies(6, ())
    assert make_scene(document, document.timeline.find_moment(6), SceneStyle()).boards == {"cross": BOARD}
    later = replace(BOARD, time_ns=6, state="playing")
    document.add_board(later)
    assert document.timeline.find_moment(6).boards == {"cross": later}
    assert document.timeline.find_moment(5).boards == {"cross": BOARD}
    document.remove_character("cross")
    assert make_scene(document, document.timeline.find_moment(6), SceneStyle()).boards == {}


def test_between_two_moments_the_lines_are_between() -> None:
    moved = replace(ROWS[0], lines=(RIGHT + np.array([0.0, 0.1, 0.0]), LEFT))
    document = Document(characters={"cross": CHARACTER})
    for time_ns, rows in ((0, ROWS), (10_000_000, (moved, replace(ROWS[1], lines=(UP + 5.0, LEFT))))):
        document.add_bodies(time_ns, ())
        document.add_board(replace(BOARD, time_ns=time_ns, rows=rows))
    between = document.timeline.find_moment(5_000_000).boards["cross"]
    np.testing.assert_allclose(between.rows[0].lines[0], RIGHT + np.array([0.0, 0.05, 0.0]))
    np.testing.assert_array_equal(between.rows[1].lines[0], UP, err_msg="that is another limb by now")


def test_camera_is_sent_to_the_edge_only_when_it_moves() -> None:
    reporter, camera = ViewReporter(), front()
    first = reporter.find_change(camera.view(1.5), 0.0)
    assert first is not None and first.eye is not None
    np.testing.assert_allclose(np.linalg.norm(first.direction), 1.0)
    assert reporter.find_change(camera.view(1.5), 1.0) is None
    camera.orbit(0.3, 0.0)
    camera.advance(10.0)
    assert reporter.find_change(camera.view(1.5), 0.05) is None, "not more often than ten times a second"
    assert reporter.find_change(camera.view(1.5), 1.1) == make_look(camera.view(1.5))


def test_chains_pointing_at_the_eye_are_detected() -> None:
    camera = front()
    assert not is_end_on(scene(), camera.view(1.5))
    camera.face(np.pi / 2, 0.05)
    camera.advance(10.0)
    assert is_end_on(scene(), camera.view(1.5))
    assert not is_end_on(scene(replace(BOARD, state="playing")), camera.view(1.5))
    turn_to_bones(camera, scene())
    camera.advance(10.0)
    assert not is_end_on(scene(), camera.view(1.5))


def test_the_camera_turns_to_where_bones_are_seen() -> None:
    camera = front()
    camera.face(np.pi / 2, 0.1)
    camera.advance(10.0)
    turn_to_bones(camera, scene())
    camera.advance(10.0)
    assert abs(camera.view(1.0).camera_from_world[2, 2]) > 0.99, "the cross lies across z"


def test_each_limb_has_one_colour_on_the_performer_the_model_and_the_card(gl) -> None:
    """For any chosen parts, a right leg has its colour on the model. Limbs without a target have the body's
    colour.
    """
    performer = Body(1, standing_joints(), np.ones(20))
    for parts in ("all", "arms", "legs", "right arm", "torso"):
        chains = body_source(performer, parts).chains
        limbs = tuple(limb_number(chain) for chain in chains)
        lines = tuple(LEFT if k else LEFT[:0] for k in range(len(chains)))
        row = MatchRow("1-1", 0, 1.0, lines, limbs, 1)
        board = MatchList("cross", "choosing", 1, 5, 0, (row,), 1)
        plain = make_capsule_rows((performer,), 1.0)
        rows = make_capsule_rows((performer,), 1.0, find_limb_tints({"cross": board}))
        card = make_cards(scene(board), front().view(1.5))[0]
        for limb, line, chain, tint in zip(limbs, lines, chains, card.tints, strict=True):
            outer = [bone for bone, (_, end) in enumerate(BONES) if end in chain[1:]]
            wanted = linear_from_srgb(255 * np.array(LIMB_COLOURS[limb])) if len(line) else plain[outer, 8:11]
            np.testing.assert_allclose(rows[outer, 8:11], np.broadcast_to(wanted, (len(outer), 3)), atol=1e-6)
            assert tint == LIMB_COLOURS[limb]
    assert len(set(LIMB_COLOURS)) == len(LIMB_COLOURS) >= 6


def standing_joints() -> np.ndarray:
    return swaying(1, 0).joints


def test_the_limbs_of_a_match_come_over_the_wire_and_older_edges_send_none() -> None:
    row = MatchRow("1-1", 0, 1.5, (RIGHT, LEFT), (1, 4), 7)
    board = MatchList("cross", "choosing", 7, 5, 0, (row,), 1)
    again = message_to_board(msgspec.msgpack.decode(packed(board), type=MatchesMessage))
    assert (again.rows[0].limbs, again.rows[0].body) == ((1, 4), 7)
    older = msgspec.msgpack.decode(packed(board))
    older[5] = [match[:5] for match in older[5]]
    old = message_to_board(msgspec.msgpack.decode(msgspec.msgpack.encode(older), type=MatchesMessage))
    assert old.rows[0].limbs == () and find_limb_tints({"cross": old}) == {}
    assert len(make_match_rows({"cross": old})[0]) == len(make_match_rows({"cross": board})[0])


def packed(board: MatchList) -> bytes:
    return msgspec.msgpack.encode(board_to_message(board))
