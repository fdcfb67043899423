"""A prepared character: all results of the preparation of a mesh for possession, and their file format."""

from __future__ import annotations

import hashlib
import io
import logging
import os
import pickle
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from enliven.character_store.store import CharacterStore
from enliven.document import Character
from enliven.errors import InputError
from enliven.files import DAMAGE, read_file, record_references
from enliven.possession import ActorSettings, BodyInMesh

log = logging.getLogger(__name__)

_NUMPY_NAMES = frozenset({"_reconstruct", "_frombuffer", "ndarray", "dtype", "scalar"})
"""Names in NumPy that are needed to unpickle arrays."""
_ENLIVEN_MODULES = ("enliven.document.", "enliven.meshes.", "enliven.possession.", "enliven.deformation.")
"""Prefixes of the modules with the dataclasses of a prepared character."""


@dataclass(frozen=True)
class PreparedCharacter:
    """A mesh that is ready for possession.

    Attributes:
        character: the mesh with the nodes of its deformation graph.
        settings: the actor's settings, with the ends and joints of this mesh.
        size: scale: metres of the mesh as modelled per metre of its rest space.
        height: height in metres of the person that the mesh shows. 0 means the height of the mesh.
        likeness: the person's skeleton in the mesh if the mesh is driven limb by limb, otherwise None.
        notes: sentences about the mesh for the log.
        references: SHA-256 of each file that the mesh's file refers to, by path relative to the mesh's
            folder. Empty for a missing file.
    """

    character: Character
    settings: ActorSettings
    size: float
    height: float
    likeness: BodyInMesh | None
    notes: tuple[str, ...] = ()
    references: Mapping[str, str] = field(default_factory=dict)

    def pack(self) -> bytes:
        """Returns the data of a file."""
        parts = tuple(getattr(self, field.name) for field in fields(self))
        return pickle.dumps(parts, protocol=5)

    @classmethod
    def unpack(cls, data: bytes) -> PreparedCharacter:
        """Returns a prepared character from the data of a file.

        Raises:
            ValueError: if the data is damaged.
        """
        try:
            prepared = cls(*_Unpickler(io.BytesIO(data)).load())
        except (*DAMAGE, InputError, EOFError, pickle.UnpicklingError, ImportError) as error:
            raise ValueError(f"the stored data is damaged ({error})") from None
        if not isinstance(prepared.character, Character) or not isinstance(prepared.settings, ActorSettings):
            raise ValueError("the stored data is not a prepared character")
        return prepared


def prepare_once(
    key: str,
    prepare: Callable[[], PreparedCharacter],
    folder: Path | None = None,
    store: CharacterStore | None = None,
) -> PreparedCharacter:
    """Returns a prepared character from the store, or prepares and stores it.

    Both results are bit-identical. For this purpose, a new result is also packed and unpacked, because the
    memory order of arrays may change the last digit of sums.

    Args:
        key: hash of all inputs except the files that a mesh refers to, from
            :func:`~enliven.character_store.key_of`.
        prepare: a function that prepares the character.
        folder: folder of the mesh's file, which contains the files that it refers to. None if it refers to no
            files.
        store: the store. None means the store in the user's folder.
    """
    store, folder = store or CharacterStore.open_user_store(), folder or Path()
    if (data := store.load(key)) is not None:
        try:
            prepared = PreparedCharacter.unpack(data)
            if prepared.references == _hash_files(prepared.references, folder):
                return prepared
        except ValueError as error:
            log.warning("a stored character cannot be used and is prepared again: %s", error)
    with record_references() as paths:
        prepared = prepare()
    names = [os.path.relpath(path, folder.resolve()) for path in paths]
    data = replace(prepared, references=_hash_files(names, folder)).pack()
    store.save(key, data)
    return PreparedCharacter.unpack(data)


def _hash_files(names: Iterable[str], folder: Path) -> dict[str, str]:
    """Returns the SHA-256 (hexadecimal) of each file in a folder, or an empty string if it cannot be read."""
    return {name: _hash_file(folder / name) for name in names}


def _hash_file(path: Path) -> str:
    """Returns the SHA-256 (hexadecimal) of a file, or an empty string if it cannot be read."""
    try:
        return hashlib.sha256(read_file(path)).hexdigest()
    except InputError:
        return ""


class _Unpickler(pickle.Unpickler):
    """An unpickler that accepts only arrays and enliven's dataclasses."""

    def find_class(self, module: str, name: str) -> Any:
        """Returns a class that a file may contain.

        Raises:
            pickle.UnpicklingError: for all other classes.
        """
        is_array = module.partition(".")[0] == "numpy" and name in _NUMPY_NAMES
        if is_array or (module.startswith(_ENLIVEN_MODULES) and name[:1].isupper()):
            return super().find_class(module, name)
        raise pickle.UnpicklingError(f"the class {module}.{name} is not allowed in a stored character")
