"""The list of known readers, and the search for a reader that recognises given files."""

from __future__ import annotations

import difflib
import glob
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path

from enliven.errors import InputError
from enliven.files import file_fault
from enliven_edge.importing.base import Reader
from enliven_edge.importing.images import describe_colour_image

ENTRY_POINTS = "enliven.readers"
"""The entry-point group for readers of other packages. Each entry names a :class:`Reader`."""
_BUILT_IN = (
    "bags.reader:BagReader",
    "depth_images:OpenCvDepthReader",
    "placed_images:PosedDepthReader",
    "placed_images:RealSenseReader",
    "tum:TumReader",
    "depth_images:RawKinectReader",
    "kinect_texts:LabanotationReader",
    "multitrack:MultiTrackReader",
    "kinect_texts:MsrAction3dReader",
    "kinect_texts:GaitReader",
    "flow_room:FlowRoomReader",
    "kinect_texts:BodyScannerReader",
    "motion_capture:MotionCaptureReader",
    "depth_images:PlainDepthReader",
)
"""The built-in readers in the order in which they are tried. The least specific one is last."""


def readers() -> dict[str, Reader]:
    """Returns every reader by name: the built-in ones, then those of other packages."""
    instances: list[Reader] = []
    for place in _BUILT_IN:
        module, _, kind = place.partition(":")
        instances.append(getattr(import_module(f"enliven_edge.importing.{module}"), kind)())
    for entry in entry_points(group=ENTRY_POINTS):
        try:
            instances.append(entry.load()())
        except Exception as error:  # An error in another package must not stop an import.
            warnings.warn(f"the reader {entry.name!r} cannot be loaded: {error}", stacklevel=2)
    return {reader.name: reader for reader in instances}


def find_reader(paths: Sequence[Path], name: str | None = None) -> Reader:
    """Returns the reader called ``name``, or else the first reader that recognises the files.

    Raises:
        InputError: for an unknown name (the message suggests the nearest known one), or if no reader
            recognises the files.
    """
    readers_by_name = readers()
    if name is not None:
        if name in readers_by_name:
            return readers_by_name[name]
        similar_names = difflib.get_close_matches(name, readers_by_name, n=1)
        remedy = (
            f"Did you mean {similar_names[0]}?"
            if similar_names
            else f"Known readers: {', '.join(readers_by_name)}."
        )
        raise InputError(f"the reader {name!r} does not exist", where="--reader", remedy=remedy)
    for reader in readers_by_name.values():
        if reader.can_read(paths):
            return reader
    kind = describe_colour_image(paths[0]) if len(paths) == 1 else None
    if kind is not None:
        raise InputError(
            f"the file is {kind}, not a depth image",
            where=str(paths[0]),
            remedy="Choose the depth image of the same moment: a PNG with one 16-bit channel, in "
            "millimetres.",
        )
    raise InputError(
        "no reader recognises " + ("this file" if len(paths) == 1 else f"any of these {len(paths)} files"),
        where=str(paths[0]),
        remedy="To see the known layouts: enliven import --list-readers",
    )


def find_files(names: Sequence[str]) -> list[Path]:
    """Returns the files named by files, folders and patterns, each once.

    A folder stands for the files directly inside it.

    Raises:
        InputError: for a name without a file, or a folder that cannot be listed.
    """
    paths: dict[Path, None] = {}
    for name in names:
        path = Path(name)
        if path.is_dir():
            try:
                matches = _list_folder(path)
            except OSError as error:
                raise file_fault(error, name, "listed") from None
        elif path.exists():
            matches = [path]
        else:
            matches = [match for match in map(Path, sorted(glob.glob(name))) if match.is_file()]
        if not matches:
            problem = "the folder contains no files" if path.is_dir() else "there is no such file"
            raise InputError(problem, where=name, remedy="Check the path.")
        paths.update(dict.fromkeys(matches))
    return list(paths)


def _list_folder(folder: Path) -> list[Path]:
    """Returns the files directly in a folder.

    Includes the files of its subfolder "depth" unless the folder itself contains images.

    Raises:
        InputError: if it is a scene of several sequences, the layout of 7-Scenes.
    """
    files = sorted(entry for entry in folder.iterdir() if entry.is_file())
    if any(path.suffix.lower() in (".png", ".jpg") for path in files):
        return files
    sequences = sorted(entry.name for entry in folder.glob("seq-*") if entry.is_dir())
    if sequences:
        problem = f"the folder contains {len(sequences)} separate recordings: {', '.join(sequences[:8])}"
        raise InputError(
            problem,
            where=str(folder),
            remedy=f"Import one recording at a time, such as {folder / sequences[0]}",
        )
    depth = folder / "depth"
    return files + (sorted(entry for entry in depth.iterdir() if entry.is_file()) if depth.is_dir() else [])
