"""Tests of stereo calibration from a printed board with known cameras: rendered boards and random points."""

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.spatial.transform import Rotation

pytest.importorskip("cv2", reason='OpenCV is not installed: pip install "./edge[libcamera]"')
from stereo_rig import create_lenses

from enliven import cli
from enliven.errors import InputError
from enliven_edge.sensors.stereo.board import CalibrationBoard
from enliven_edge.sensors.stereo.calibration import load_calibration
from enliven_edge.sensors.stereo.calibration_quality import PairSelector, rate_solution
from enliven_edge.sensors.stereo.rectification import Rectification
from enliven_edge.sensors.stereo.stereo_solver import MIN_PAIRS, BoardSighting, rectify_points, solve

BOARD = CalibrationBoard()
WIDTH, HEIGHT = 320, 200
SCALE = 2000
"""Pixels per metre of the rendered board, so that a pixel is half a millimetre."""


def poses(count, seed=0, tilt=30.0, side=0.45, near=0.4, far=0.8):
    """Returns (rotation, centre) of boards across the field of view of a 70-degree camera."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        turn = Rotation.from_euler("xyz", random.uniform(-tilt, tilt, 3), degrees=True).as_matrix()
        z = random.uniform(near, far)
        yield turn, np.array([random.uniform(-side, side), random.uniform(-0.7 * side, 0.7 * side), 1.0]) * z


def placed(points, turn, middle):
    """Returns points of the board in the left camera's frame."""
    centre = np.array([BOARD.columns, BOARD.rows, 0]) * 0.5 * BOARD.square
    return (points - centre) @ turn.T + middle


def sightings(lenses, count=24, noise=0.1, seed=0, **of):
    """Simulates two cameras' detections of board corners, with an error in pixels."""
    random = np.random.default_rng(seed)
    boards = []
    for number, pose in enumerate(poses(count, seed, **of)):
        corners = placed(BOARD.points, *pose)
        detections = []
        for lens in lenses:
            pixels = lens.pixels(corners) + noise * random.standard_normal((len(corners), 2))
            inside = (pixels > 0).all(1) & (pixels < [lens.width, lens.height]).all(1)
            detections.append({n: pixels[n] for n in np.flatnonzero(inside)})
        boards.append(BoardSighting(f"left-{number:02}.png", *detections))
    return boards


def drawn(rectangles):
    """Returns (h, w) the board's black rectangles on white, with a white margin of one square."""
    rim = round(BOARD.square * SCALE)
    width, height = (round(n * BOARD.square * SCALE) + 2 * rim for n in (BOARD.columns, BOARD.rows))
    sheet = np.full((height, width), 255.0)
    for x, y, w, h in rectangles * SCALE:
        sheet[round(y) + rim : round(y + h) + rim, round(x) + rim : round(x + w) + rim] = 0
    return sheet


SHEET = drawn(BOARD.rectangles())


class Studio:
    """Renders the printed board in front of a grey room. The 2 x 2 rays per pixel are cast only once."""

    def __init__(self, lens):
        self.lens, steps = lens, np.array([-0.25, 0.25])
        u = (np.arange(lens.width)[:, None] + steps).ravel()
        v = (np.arange(lens.height)[:, None] + steps).ravel()
        self.eye, looks = lens.rays(*(each.ravel() for each in np.meshgrid(u, v)))
        self.looks = looks.astype(np.float32)

    def photograph(self, turn, middle, seed=0):
        """Returns the (H, W) image of the lens."""
        normal = turn[:, 2]
        length = ((middle - self.eye) @ normal) / (self.looks @ normal)
        board = (self.eye - middle + self.looks * length[:, None]) @ turn[:, :2]
        at = (board + (np.array([BOARD.columns, BOARD.rows]) / 2 + 1) * BOARD.square) * SCALE
        column, row = np.floor(at).astype(int).T
        on = (column >= 0) & (row >= 0) & (column < SHEET.shape[1]) & (row < SHEET.shape[0])
        light = np.full(len(on), 100.0)
        light[on] = 30 + 0.75 * SHEET[row[on], column[on]]
        light = light.reshape(self.lens.height, 2, self.lens.width, 2).mean((1, 3))
        light += np.random.default_rng(seed).normal(0, 1.5, light.shape)
        return np.clip(np.rint(light), 0, 255).astype(np.uint8)


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    """Renders a folder of image pairs. Returns the folder and the renderers."""
    folder, studios = (
        tmp_path_factory.mktemp("pairs"),
        [Studio(lens) for lens in create_lenses(WIDTH, HEIGHT)],
    )
    for number, pose in enumerate(poses(9, 4, tilt=25, side=0.25, near=0.36, far=0.5)):
        for name, studio in zip(("left", "right"), studios, strict=True):
            Image.fromarray(studio.photograph(*pose, seed=number)).save(folder / f"{name}-{number:02}.png")
    return folder, studios


@pytest.mark.slow
def test_a_rendered_board_is_found_to_a_fifth_of_a_pixel(pairs):
    studio = pairs[1][0]
    pose = Rotation.from_euler("xyz", (12, -15, 5), degrees=True).as_matrix(), np.array([0.01, 0.0, 0.38])
    corners = BOARD.find(studio.photograph(*pose))
    true = studio.lens.pixels(placed(BOARD.points, *pose))
    off = [np.linalg.norm(point - true[number]) for number, point in corners.items()]
    # A marker's cell is 2.5 px wide here, so some markers are not detected.
    assert len(off) >= 18 and np.median(off) < 0.2 and max(off) < 0.6
    assert BOARD.find(np.zeros((HEIGHT, WIDTH), np.uint8)) == {}


def test_the_sheet_is_the_board_to_the_millimetre(tmp_path, capsys):
    path = tmp_path / "board.pdf"
    assert cli.run(["calibrate-stereo", "--print", str(path), "--square", "38"]) == 0
    text = path.read_bytes().decode("latin-1")
    numbers = [
        [float(n) for n in line]
        for line in re.findall(r"^([\d.]+) ([\d.]+) ([\d.]+) ([\d.]+) re$", text, re.M)
    ]
    across, down = map(float, re.search(r"MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", text).groups())
    assert (across, down) == pytest.approx((297 * 72 / 25.4, 210 * 72 / 25.4), abs=1e-3)
    mm = np.array(numbers) * 25.4 / 72
    squares = mm[mm[:, 2] > 30]
    assert squares[:, 2:] == pytest.approx(38.0, abs=1e-3)
    assert np.ptp(squares[:, 0]) == pytest.approx(6 * 38.0, abs=1e-3)
    # Its rows are counted from the bottom. After reversing them, the detector finds the whole board.
    x, y = mm[:, 0].min(), (mm[:, 1] + mm[:, 3]).max()
    mirrored = np.stack([mm[:, 0] - x, y - mm[:, 1] - mm[:, 3], mm[:, 2], mm[:, 3]], -1) * 1e-3
    sheet = drawn(mirrored)[::2, ::2].astype(np.uint8)
    corners = BOARD.find(sheet)
    assert len(corners) == len(BOARD.points)
    expected = (BOARD.points[:, :2] + BOARD.square) * SCALE / 2
    assert max(np.linalg.norm(point - expected[n]) for n, point in corners.items()) < 1.5


@pytest.mark.slow
@settings(max_examples=3)
@given(st.integers(0, 1000), st.floats(0.06, 0.2), st.floats(-2, 2))
def test_cameras_are_found_from_what_they_see_of_a_board(seed, baseline, crooked):
    lenses = create_lenses(baseline=baseline, crooked=crooked)
    solution = solve(BOARD, sightings(lenses, seed=seed), (640, 400))
    solved = solution.calibration
    assert solved is not None and all("both" in why or "not see" in why for why in solution.left_out.values())
    for camera, true in zip((solved.left, solved.right), lenses, strict=True):
        assert (camera.fx, camera.fy) == pytest.approx(true.focal, rel=0.01)
        assert (camera.cx, camera.cy) == pytest.approx(true.centre, abs=5)
    assert solved.baseline == pytest.approx(baseline, rel=0.01)
    assert solved.reprojection < 0.2 and solved.epipolar < 0.25 and solution.disparity_error < 0.4


def test_a_pair_that_does_not_fit_is_left_out_by_name():
    seen = sightings(create_lenses())
    seen[5] = replace(seen[5], right={n: np.add(p, (0.0, 3.0)) for n, p in seen[5].right.items()})
    seen[7] = replace(seen[7], left={})
    seen[8] = replace(seen[8], right=dict(list(seen[8].right.items())[:4]))
    solution = solve(BOARD, seen, (640, 400))
    assert set(solution.left_out) == {seen[n].name for n in (5, 7, 8)}
    assert "px off" in solution.left_out[seen[5].name]
    assert solution.left_out[seen[7].name] == "the left camera does not see the board"
    assert solution.calibration.epipolar < 0.25


def test_good_calibration_is_judged_good_with_its_error():
    judgement = rate_solution(BOARD, solve(BOARD, sightings(create_lenses(), 30), (640, 400)))
    assert judgement.verdict == "good" and judgement.is_usable and not judgement.advice
    facts = dict(judgement.facts)
    assert facts["baseline"] == "100.0 mm" or abs(float(facts["baseline"].split()[0]) - 100) < 0.5
    assert int(re.search(r"expected error (\d+) mm", facts["depth at 2 m"])[1]) <= 20
    assert "left 70 degrees" in facts["lenses"]


@pytest.mark.parametrize(("seed", "noise"), [(0, 0.1), (2, 0.1), (1, 0.3), (3, 0.5)])
def test_reported_disparity_error_covers_the_true_error(seed, noise):
    """The error is measured at 2 m over the whole image with known cameras. Boards were at most 0.8 m
    away.
    """
    lenses = create_lenses()
    solution = solve(BOARD, sightings(lenses, noise=noise, seed=seed), (640, 400))
    rectification = Rectification(solution.calibration)
    across, down = np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-0.6, 0.6, 7))
    points = np.stack([across, down, np.full_like(across, 2.0)], -1).reshape(-1, 3)
    left, right = rectify_points(
        rectification, solution.calibration, *(lens.pixels(points) for lens in lenses)
    )
    focal_baseline = rectification.intrinsics.fx * rectification.baseline
    true = focal_baseline / (points @ rectification.rotations[0].T)[:, 2]
    off = np.sqrt(np.mean((left[:, 0] - right[:, 0] - true) ** 2))
    assert 0.7 * off < solution.disparity_error < 8 * off


@pytest.mark.parametrize(
    ("of", "sentence"),
    [
        ({"tilt": 3.0}, "Tilt the board"),
        ({"side": 0.05, "near": 0.7, "far": 0.8}, "has not seen the board at the upper left"),
        ({"noise": 1.5}, "The corners are inaccurate"),
        ({"count": MIN_PAIRS - 1}, f"Capture at least {MIN_PAIRS} pairs"),
    ],
)
def test_insufficient_calibration_gives_advice(of, sentence):
    judgement = rate_solution(BOARD, solve(BOARD, sightings(create_lenses(), **of), (640, 400)))
    assert not judgement.is_usable and any(sentence in each for each in judgement.advice), judgement


def test_exchanged_cameras_are_reported():
    judgement = rate_solution(BOARD, solve(BOARD, sightings(create_lenses()[::-1]), (640, 400)))
    assert not judgement.is_usable and "are swapped" in judgement.advice[0]


@pytest.mark.slow
def test_the_command_writes_what_a_driver_can_use(pairs, tmp_path, capsys):
    folder, (studio, _) = pairs
    path = tmp_path / "stereo.toml"
    code = cli.run(["calibrate-stereo", str(folder), "-o", str(path), "--accept-doubt"])
    out, err = capsys.readouterr()
    assert code == 0, err
    solved = load_calibration(path)
    assert (solved.width, solved.height) == (WIDTH, HEIGHT) and solved.baseline == pytest.approx(
        0.1, rel=0.02
    )
    assert solved.left.fx == pytest.approx(studio.lens.focal[0], rel=0.02)
    assert solved.epipolar < 0.3 and "rows" in out and str(path) in out
    assert tomllib.loads(path.read_text())["version"] == 1 and path.read_text().startswith(
        "# Stereo calibration, from enliven calibrate-stereo, "
    )


def test_too_few_pairs_keep_the_old_file(pairs, tmp_path, capsys):
    few, path = tmp_path / "few", tmp_path / "stereo.toml"
    few.mkdir()
    for file in sorted(pairs[0].iterdir()):
        if "-00" in file.name or "-01" in file.name:
            (few / file.name).write_bytes(file.read_bytes())
    path.write_text("old")
    assert cli.run(["calibrate-stereo", str(few), "-o", str(path)]) == 3
    assert "Capture at least 8 pairs" in capsys.readouterr().err and path.read_text() == "old"


@pytest.mark.parametrize(
    ("words", "what"),
    [
        ([], "the folder of the image pairs is missing"),
        (["missing"], "the folder does not exist"),
        (["."], "no image pairs"),
        (["--squares", "7by5", "."], "7by5"),
        (["--squares", "2x2", "."], "squares is impossible"),
        (["--square", "0", "."], "0 mm wide"),
        (["--print", "board.png"], ".pdf"),
        (["--print", "board.pdf", "--square", "200"], "no sheet"),
    ],
)
def test_invalid_calibration_input_is_reported(words, what, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.run(["calibrate-stereo", *words]) == 3
    assert what in capsys.readouterr().err


def test_an_image_without_partner_or_of_another_size_is_named(tmp_path, capsys):
    for name, size in (("left-1", 64), ("right-1", 64), ("left-2", 64)):
        Image.fromarray(np.zeros((size, size), np.uint8)).save(tmp_path / f"{name}.png")
    assert cli.run(["calibrate-stereo", str(tmp_path)]) == 3
    assert "left-2.png" in capsys.readouterr().err
    Image.fromarray(np.zeros((32, 64), np.uint8)).save(tmp_path / "right-2.png")
    assert cli.run(["calibrate-stereo", str(tmp_path)]) == 3
    assert (
        "right-2.png: the image has 64 x 32 pixels, but the first image has 64 x 64"
        in capsys.readouterr().err
    )
    (tmp_path / "right-2.png").write_bytes(b"\x89PNG\r\n\x1a\n damaged")
    assert cli.run(["calibrate-stereo", str(tmp_path)]) == 3
    assert "damaged" in capsys.readouterr().err


def test_live_pairs_are_kept_where_the_board_is_still_and_somewhere_new(pairs):
    keeper, level = PairSelector(BOARD), np.eye(3)
    first, second = (
        [studio.photograph(level, np.array([x, 0.0, 0.4])) for studio in pairs[1]] for x in (0.02, 0.1)
    )
    assert keeper.offer(*first) == "hold the board still"
    assert keeper.offer(*first) == ""
    assert keeper.offer(*first) == "move or tilt the board"
    assert keeper.offer(*second) == "hold the board still"
    assert keeper.offer(*second) == "" and len(keeper.kept) == 2
    nothing = np.zeros_like(first[0])
    assert keeper.offer(first[0], nothing) == "the right camera does not see enough of the board"


def test_a_board_of_any_size_has_its_own_corners():
    board = CalibrationBoard(5, 4, 0.05)
    assert len(board.points) == 12 and board.points[:, :2].max() == pytest.approx(0.2)
    with pytest.raises(InputError):
        CalibrationBoard(20, 20)
