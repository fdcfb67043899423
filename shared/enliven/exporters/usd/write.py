"""Writes characters and their motion as Universal Scene Description: .usda (text), .usdc or .usdz (package).

A character with a skeleton becomes a SkelRoot with a Skeleton, a SkelAnimation and a skinned mesh. All other
characters become meshes with time-sampled points. So the surfaces of possessed meshes and puppets are exact.
Images are stored in a folder next to a .usda or .usdc, and inside the package of a .usdz.

The required library, usd-core, is an optional dependency. It is imported only if a USD file is written.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path

from enliven.errors import InputError, ResourceError, find_plain_reason
from enliven.exporters.performance import Performance
from enliven.exporters.placement import PLACEMENTS, units_per_metre
from enliven.exporters.registry import Exporter
from enliven.files import TemporaryFolder, explain_write_errors, replace_file, replace_folder

_OWN_IMAGE = re.compile(r"texture_\d+\.(png|jpg)")
"""Pattern of the file names in a folder of images. A folder that contains other files is not replaced."""
_REMEDY = "Choose another output file."


def write_usd(
    path: Path | str,
    performances: Sequence[Performance],
    name: str = "enliven",
    unit: str = "m",
    up: str = "y",
    progress: Callable[[float], object] | None = None,
) -> None:
    """Writes characters with their motion into one stage.

    Args:
        path: path of the file, with the suffix .usda, .usdc or .usdz.
        name: the title.
        unit: unit of lengths, "m" or "cm". It is stored in the file.
        up: vertical axis of the performances, "y" or "z". It is stored in the file.
        progress: called with the finished fraction. An exception that it raises ends the export.

    Raises:
        InputError: if no character is given, a character has no mesh, or the unit is unknown.
        ResourceError: if the library is missing, or the file cannot be written.
    """
    path = Path(path)
    _check_options(unit)
    if not performances:
        raise InputError(
            "no character was selected", where=str(path), remedy="Select at least one character."
        )
    from pxr import Tf

    from enliven.exporters.usd.stage import UsdStage

    kind = path.suffix.lower().removeprefix(".")
    with TemporaryFolder("usd") as temporary, ExitStack() as outputs:
        folder = Path(temporary)
        images = f"{path.stem}_textures" if kind != "usdz" else "textures"
        try:
            stage = UsdStage(name, images, units_per_metre(unit), up)
            for number, performance in enumerate(performances):
                stage.add(performance, _part_of_progress(progress, number, len(performances)))
            stage_path = stage.save(folder, kind)
        except Tf.ErrorException as error:
            problem = f"the file cannot be written ({find_plain_reason(error)})"
            raise ResourceError(problem, where=str(path), remedy=_REMEDY) from None
        part = outputs.enter_context(replace_file(path, _REMEDY))
        with explain_write_errors(path, _REMEDY):
            shutil.copyfile(stage_path, part)
        if kind != "usdz" and stage.images:
            target = path.with_name(images)
            image_folder = outputs.enter_context(replace_folder(target, _is_own_image, _REMEDY))
            with explain_write_errors(target, _REMEDY):
                for image_name, data in stage.images.items():
                    (image_folder / image_name).write_bytes(data)


def _check_options(unit: str = "m", **_: object) -> None:
    """Raises InputError if the unit is unknown, and ResourceError if the library is missing."""
    units_per_metre(unit)
    if find_spec("pxr") is None:
        problem = "USD files need the package usd-core, which is not installed"
        remedy = 'Install it: pip install "enliven[usd]" (in a checkout: "./shared[usd]").'
        raise ResourceError(problem, where="USD", remedy=remedy)


def _is_own_image(name: str) -> bool:
    return _OWN_IMAGE.fullmatch(name) is not None


def _part_of_progress(
    progress: Callable[[float], object] | None, number: int, count: int
) -> Callable[[float], object]:
    """Returns a progress callback for character ``number`` of ``count``. It converts the character's progress
    to the total progress."""

    def report(fraction: float) -> None:
        if progress is not None:
            progress((number + fraction) / count)

    return report


USD = Exporter(write_usd, pointwise=True, placements=PLACEMENTS, check=_check_options)
