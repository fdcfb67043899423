"""``enliven calibrate-stereo``: turns two cameras into a depth sensor, with a printed board that both see."""

from __future__ import annotations

import datetime
import re
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from enliven.commands.terminal import facts_table, make_plain_console, print_line
from enliven.errors import InputError, ResourceError

if TYPE_CHECKING:
    from enliven_edge.sensors.stereo.board import CalibrationBoard
    from enliven_edge.sensors.stereo.calibration_quality import CalibrationQuality
    from enliven_edge.sensors.stereo.stereo_solver import BoardSighting

_CHECK_INTERVAL_S = 0.3
"""Interval between two checks of live cameras, in seconds. Moving a board by hand takes longer."""
_MAX_TIME_OFFSET_MS = 20.0
"""Maximum time difference in milliseconds between the two live images of a pair. The limit can be generous,
because the board is held still.
"""
_PAIR_TIMEOUT_S = 10.0
"""Maximum seconds without an image pair before the command gives up."""


def calibrate_stereo(
    folder: Annotated[
        Path | None,
        typer.Argument(
            help="Folder of the image pairs, such as left-01.png and right-01.png. --live writes new "
            "pairs there."
        ),
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Output file with the calibration.")] = Path(
        "stereo.toml"
    ),
    print_to: Annotated[
        Path | None, typer.Option("--print", help="Write the board to this .pdf file for printing, and exit.")
    ] = None,
    squares: Annotated[str, typer.Option(help="Number of squares of the board, across x down.")] = "7x5",
    square: Annotated[
        float, typer.Option(help="Side of a square in millimetres, measured on the printed board.")
    ] = 38.0,
    live: Annotated[
        bool, typer.Option(help="Capture the image pairs now, with two libcamera cameras.")
    ] = False,
    left: Annotated[
        str, typer.Option(help="Number of the left camera, seen from behind, in libcamera.")
    ] = "0",
    right: Annotated[str, typer.Option(help="Number of the right camera in libcamera.")] = "1",
    size: Annotated[
        str, typer.Option(help="Size of the live images in pixels. The sensor must use the same size.")
    ] = "640x400",
    pairs: Annotated[
        int, typer.Option(min=8, max=200, help="Number of image pairs that --live captures.")
    ] = 24,
    accept_doubt: Annotated[
        bool,
        typer.Option(
            help="Write the result even if its accuracy is too low. The file then contains a warning."
        ),
    ] = False,
) -> None:
    """Turn two cameras into a depth sensor: calibrate their lenses and relative pose with a printed board.

    Print the board at 100 %, glue it to a flat panel, and measure a square. Capture about 24 image pairs.
    Show the board near and far, in every corner of both images, and tilted to all sides. Hold it still.

    \b
      enliven calibrate-stereo --print board.pdf
      enliven calibrate-stereo PAIRS --square 37.9 -o stereo.toml
      enliven calibrate-stereo --live PAIRS --square 37.9 -o stereo.toml
      enliven run --sensor libcamera --set calibration=stereo.toml
    """
    from enliven_edge.sensors.stereo.board import CalibrationBoard

    board = CalibrationBoard(*_parse_size(squares, "--squares"), 1e-3 * square)
    if print_to is not None:
        _write_board(board, print_to)
        return
    if folder is None:
        raise InputError(
            "the folder of the image pairs is missing",
            where="calibrate-stereo",
            remedy="Name a folder with image pairs, or use --live and name a folder for new pairs.",
        )
    if live:
        _record_pairs(board, folder, (left, right), _parse_size(size, "--size"), pairs)
    _calibrate(board, folder, output, accept_doubt)


def _write_board(board: CalibrationBoard, path: Path) -> None:
    if path.suffix.lower() != ".pdf":
        raise InputError(
            f"the file name ends in {path.suffix!r}", where=str(path), remedy="Use a name that ends in .pdf."
        )
    try:
        path.write_bytes(board.pdf())
    except OSError as error:
        raise ResourceError(
            f"the file cannot be written ({error.strerror or error})", where=str(path)
        ) from None
    print_line(
        f"{path}: print this file at 100 %, and glue the board to a flat panel. Measure the side of a "
        "square in millimetres, and pass it with --square."
    )


def _calibrate(board: CalibrationBoard, folder: Path, output: Path, accept_doubt: bool) -> None:
    """Solves the calibration, prints its quality, and writes it if it is good enough or the user accepts
    it."""
    from enliven_edge.sensors.stereo.calibration import save_calibration
    from enliven_edge.sensors.stereo.calibration_quality import rate_solution
    from enliven_edge.sensors.stereo.stereo_solver import solve

    sightings, size = _find_boards(board, folder)
    solution = solve(board, sightings, size)
    judgement = rate_solution(board, solution)
    _print_quality(judgement)
    calibration = solution.calibration
    if calibration is None or not (judgement.is_usable or accept_doubt):
        unchanged_note = f"; {output} was not changed" if output.exists() else ""
        raise InputError(
            f"the calibration is not good enough{unchanged_note}",
            where=str(folder),
            remedy=" ".join(judgement.advice)
            + (" To use this calibration nevertheless, add --accept-doubt." if calibration else ""),
        )
    facts = [f"{name}: {value}" for name, value in judgement.facts]
    today = datetime.date.today().isoformat()
    comments = [
        f"Stereo calibration, from enliven calibrate-stereo, {today}; {judgement.verdict}.",
        *judgement.advice,
    ]
    save_calibration(output, calibration, [*comments, *facts])
    print_line(f"{output} was written. To use it: enliven run --sensor libcamera --set calibration={output}")


def _find_boards(board: CalibrationBoard, folder: Path) -> tuple[list[BoardSighting], tuple[int, int]]:
    """Finds the board in a folder's image pairs.

    Returns the sightings and the (width, height) of the images in pixels.
    """
    from enliven_edge.sensors.stereo.pair_folder import image_pairs, read_grey
    from enliven_edge.sensors.stereo.stereo_solver import BoardSighting

    sightings, size = [], (0, 0)
    for files in image_pairs(folder):
        images = [read_grey(file) for file in files]
        for file, image in zip(files, images, strict=True):
            size = size if any(size) else (image.shape[1], image.shape[0])
            if image.shape != size[::-1]:
                image_size, first_size = (
                    f"{dimensions[0]} x {dimensions[1]}" for dimensions in (image.shape[::-1], size)
                )
                problem = f"the image has {image_size} pixels, but the first image has {first_size}"
                raise InputError(problem, where=str(file), remedy="Capture all images in the same size.")
        sightings.append(BoardSighting(files[0].name, *map(board.find, images)))
    return sightings, size


def _record_pairs(
    board: CalibrationBoard, folder: Path, names: tuple[str, str], size: tuple[int, int], pairs: int
) -> None:
    """Saves pairs of live images in a folder."""
    from PIL import Image

    from enliven_edge.sensors.drivers.libcamera_images import LibcameraImages
    from enliven_edge.sensors.stereo.calibration_quality import PairSelector
    from enliven_edge.sensors.stereo.pairing import ImagePairing

    images = LibcameraImages(list(names), size)
    try:
        pairing, selector = ImagePairing(images.name, round(1e6 * _MAX_TIME_OFFSET_MS)), PairSelector(board)
        folder.mkdir(parents=True, exist_ok=True)
        last_message, checked_at, last_pair_at = "", 0.0, time.monotonic()
        while len(selector.kept) < pairs:
            if time.monotonic() - last_pair_at > _PAIR_TIMEOUT_S:
                raise ResourceError(
                    f"no image pair arrived for {_PAIR_TIMEOUT_S:.0f} s",
                    where=images.name,
                    remedy="Check the cables of both cameras.",
                )
            try:
                picture = images.read(1.0)
            except TimeoutError:
                continue
            pair = pairing.add(picture) if picture is not None else None
            if pair is None:
                continue
            last_pair_at = time.monotonic()
            if last_pair_at - checked_at < _CHECK_INTERVAL_S:
                continue
            checked_at = last_pair_at
            rejection = selector.offer(pair[0].image, pair[1].image)
            if not rejection:
                for side, image in zip(("left", "right"), pair, strict=True):
                    Image.fromarray(image.image).save(folder / f"{side}-{len(selector.kept):03}.png")
            status = rejection or f"{len(selector.kept)} of {pairs} pairs captured"
            if status != last_message:
                print_line(status)
            last_message = status
    finally:
        images.close()


def _print_quality(judgement: CalibrationQuality) -> None:
    advice = [("to do", sentence) for sentence in judgement.advice]
    make_plain_console().print(facts_table([("calibration", judgement.verdict), *judgement.facts, *advice]))


def _parse_size(text: str, where: str) -> tuple[int, int]:
    """Parses a size such as 640x400. Returns the two numbers."""
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    if not match:
        raise InputError(f"{text!r} is not a size such as 7x5", where=where, remedy="For example: 7x5")
    return int(match[1]), int(match[2])
