"""Messages about the objects in a scan: the selected one, the others, and the places where the moved object
was found.
"""

from __future__ import annotations

import numpy as np

from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.scanning import Scanner, extract_surface, find_focus, find_ground, find_parts, level_mesh
from enliven.scanning.objects.moved_scanner import MovedScanner

_NOT_SEEN_TO_TURN = (
    "No rotation was detected, so the mesh shows the object as it stood. Keep the floor around the object "
    "and some of the room in view. Turn the object once, in ten seconds or more."
)
"""Message if an object should have been tracked while it turned, but did not turn."""
_COARSE_VOLUME = 1
"""Index of the volume with voxels of 16 mm. It is used to count objects, because this takes only a tenth of a
second."""


def describe_objects(scanner: Scanner | MovedScanner) -> list[str]:
    """Returns sentences about a scan's objects: which of several objects was selected, and where it was
    found.
    """
    first = scanner.rests[0].scanner if isinstance(scanner, MovedScanner) else scanner
    # If motion selected the object, it is the moved part, even if the camera looked more at another object.
    is_chosen_by_motion = isinstance(scanner, MovedScanner) and scanner.followed_images
    sentences = [*([] if is_chosen_by_motion else _describe_choice(first)), *describe_places(scanner)]
    if isinstance(scanner, MovedScanner) and len(scanner.rests) == 1 and not scanner.followed_images:
        is_turned = scanner.settings.moved.followed
        sentences[-1] = (
            _NOT_SEEN_TO_TURN if is_turned else f"{sentences[-1]} A scan without --moved is quicker."
        )
    return sentences


def describe_places(scanner: Scanner | MovedScanner) -> list[str]:
    """Returns sentences about the places where a moved object was found, and about failed searches."""
    if not isinstance(scanner, MovedScanner):
        return []
    sentences: list[str] = []
    if scanner.unplaced:
        lost = sum(place.count for place in scanner.unplaced)
        note = f"{lost} images are not in the mesh, because the object was not found in them."
        sentences.append(
            f"{note} Show more of the sides that were already scanned, and hold still while the object rests."
        )
    if scanner.followed_images:
        sentences.append(
            f"The moving object was tracked separately from the room in {scanner.followed_images} images."
        )
    if len(scanner.rests) == 1 and scanner.followed_images:
        return sentences
    if len(scanner.rests) == 1:
        sentences.append("The object did not move, so the mesh shows the object where it stood.")
    else:
        sentences.append(
            f"The object was found in {len(scanner.rests)} places, and the mesh contains all of them."
        )
    return sentences


def _describe_choice(scanner: Scanner) -> list[str]:
    """Returns a sentence that lists the objects near the focus, largest first. The result is empty if there
    is only one.
    """
    mesh, cut = extract_surface(scanner.volumes[_COARSE_VOLUME]), scanner.settings.cut_out
    try:
        ground = find_ground(mesh)
    except InputError:
        return []
    parts = find_parts(mesh, ground, find_focus([pose for _, pose in scanner.poses]), cut)
    if len(parts) < 2:
        return []
    sizes = [_size_cm(level_mesh(part, ground)) for part in parts]
    size_list = ", ".join(f"{n}: {size}" for n, size in enumerate(sizes, 1))
    return [
        f"{len(parts)} objects are on the floor ({size_list} cm). Number {cut.number} was kept; --thing "
        "chooses another."
    ]


def _size_cm(mesh: Mesh) -> str:
    """Returns width, height and depth of a mesh in centimetres."""
    return " x ".join(f"{100 * side:.0f}" for side in np.ptp(mesh.bounds, axis=0))
