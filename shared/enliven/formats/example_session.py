"""Sessions of examples (TOML): a mesh, its control points and key poses, and what it plays, made by hand.

    [mesh]
    file = "cactus.off"
    height = 1.2

    [[take]]
    file = "traffic.bvh"

    [[point]]
    name = "left arm"
    at = [0.4, 0.9, 0.0]              # or vertex = 4711
    joint = "LeftHand"

    [[pose]]
    time = 3.2                        # or frame = 96
    moves = { "left arm" = [0.0, 0.3, 0.1] }      # or places = { ... }

    [[layer]]
    loop = true

Metres in the mesh's frame, once it is fitted: upright, standing on y = 0, its box centred. Files are relative
to the session's, and may begin with a variable of the environment ("$MESHES/cactus.off"). All tables:
:mod:`enliven.formats.session_tables`; written by :func:`enliven.formats.session_text.write_session`.
"""

from __future__ import annotations

import difflib
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from enliven.arrays import Float
from enliven.errors import InputError
from enliven.examples.constraints import Coupling, Position, Velocity
from enliven.examples.locomotion import Switch
from enliven.formats.project_file import read_project
from enliven.formats.session_tables import (
    CouplingTable,
    LayerTable,
    MeshTable,
    PointTable,
    PoseTable,
    PositionTable,
    PuppetTable,
    SettingsTable,
    SwitchTable,
    SymmetryTable,
    TakeTable,
    VelocityTable,
)
from enliven.formats.takes import read_take
from enliven.mesh import Mesh, fit_height
from enliven.mesh_files import load_mesh
from enliven.modeling.mirror_plane import plane_of_symmetry
from enliven.modeling.puppets import (
    add_key_pose,
    add_point,
    change_point,
    make_puppet,
    play_take,
    set_symmetry,
)
from enliven.project import Project
from enliven.puppet import Plane, Puppet
from enliven.rotation import from_rotation_vector, rotate
from enliven.settings import load_settings

T = TypeVar("T")

TABLES = ("mesh", "take", "puppet", "symmetry", "settings", "point", "pose", "layer")
IN_LAYER = ("position", "velocity", "coupling", "switch")


@dataclass(frozen=True, eq=False)
class Session:
    """What a session file has.

    Attributes:
        project: with one puppet and the takes.
        puppet: the puppet's name.
        notes: what was odd about the files.
        mesh: where the mesh is from.
        takes: where each take is from, by its name.
    """

    project: Project
    puppet: str
    notes: tuple[str, ...]
    mesh: MeshTable
    takes: Mapping[str, TakeTable]


def read_session(path: Path | str) -> Session:
    """A session from its file.

    Raises:
        InputError: for an unreadable file, and for what cannot be: which table says it, and which key.
    """
    path = Path(path)
    try:
        found = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError("there is no such file", where=str(path), mend="Check the path.") from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"it is not readable TOML ({error})", where=str(path)) from None
    return _Reader(path, found).session()


class _Reader:
    """The steps from tables to a project; each says in its errors which table was read."""

    def __init__(self, path: Path, found: Mapping[str, Any]) -> None:
        self._path, self._found = path, found
        check_tables(found, TABLES, str(path))
        self._notes: list[str] = []
        self._takes: dict[str, TakeTable] = {}
        self._project, self._name = Project(), ""

    def session(self) -> Session:
        """All of it."""
        if "mesh" not in self._found:
            raise InputError("it has no [mesh]", where=str(self._path), mend='Say [mesh] file = "...".')
        table = self._one("mesh", MeshTable)
        self._said("[mesh]", self._read_mesh, table)
        for number, take in self._many("take", TakeTable):
            self._said(f"[[take]] {number}", self._read_take, take)
        for number, point in self._many("point", PointTable):
            self._said(f"[[point]] {number}", self._read_point, point)
        for number, pose in self._many("pose", PoseTable):
            self._said(f"[[pose]] {number}", self._read_pose, pose)
        if "symmetry" in self._found:
            self._said("[symmetry]", self._read_symmetry, self._one("symmetry", SymmetryTable))
        self._read_settings()
        for number, layer in enumerate(self._listed("layer"), 1):
            self._read_layer(number, layer)
        return Session(self._project, self._name, tuple(self._notes), table, self._takes)

    def _read_mesh(self, table: MeshTable) -> None:
        path = self._beside(table.file)
        own = self._one("puppet", PuppetTable)
        if path.suffix.lower() == ".enliven":
            name, mesh = _mesh_of(path, table.puppet)
        else:
            mesh, notes = load_mesh(path)
            self._notes += notes
            name = path.stem
        self._name = own.name or name
        self._project = make_puppet(self._project, fitted(mesh, table), self._name)
        self._put(self._puppet.with_changes(place=np.array(own.place), turn=np.array(own.turn)))

    def _read_take(self, table: TakeTable) -> None:
        path = self._beside(table.file)
        clip, notes = read_take(path, table.animation, table.start, table.end)
        name = table.name or clip.id
        if name in self._takes:
            mend = "Give it another name."
            raise InputError(f"there is a take {name!r} already", where=str(path), mend=mend)
        self._project = self._project.with_takes(replace(clip, id=name))
        self._takes[name] = replace(table, name=name)
        self._notes += notes

    def _read_point(self, table: PointTable) -> None:
        vertex = table.vertex
        if (vertex is None) == (table.at is None):
            raise InputError("it needs a vertex or a place", mend="Say vertex = 4711 or at = [x, y, z].")
        if vertex is None:
            vertex = _nearest(self._puppet.mesh, np.array(table.at))
        self._project = add_point(self._project, self._name, vertex, table.name, table.joint, table.foot)
        point = self._puppet.points[-1].name
        self._project = change_point(self._project, self._name, point, weight=table.weight)

    def _read_pose(self, table: PoseTable) -> None:
        take = self._take(table.take)
        if (table.time is None) == (table.frame is None):
            raise InputError("it needs a time or a frame", mend="Say time = 3.2 or frame = 96.")
        if table.places is not None and table.moves is not None:
            raise InputError("it has places and moves", mend="Give one of them.")
        step = self._project.takes[take].step
        time = table.time if table.time is not None else (table.frame or 0) * step
        places = self._puppet.rest.copy()
        for name, value in (table.places or {}).items():
            places[self._puppet.index(name)] = value
        for name, value in (table.moves or {}).items():
            places[self._puppet.index(name)] += value
        self._project = add_key_pose(self._project, self._name, take, time, places)

    def _read_symmetry(self, table: SymmetryTable) -> None:
        plane: Plane | None = Plane(table.point, table.normal)
        if table.find:
            plane = plane_of_symmetry(self._puppet.mesh)
            if plane is None:
                mend = "Give a point and a normal, or leave [symmetry] out."
                raise InputError("the mesh has no plane of symmetry", mend=mend)
        self._project = set_symmetry(self._project, self._name, plane)

    def _read_settings(self) -> None:
        told = self._one("settings", SettingsTable)
        self._put(
            self._puppet.with_changes(
                surface=told.surface, examples=told.examples, locomotion=told.locomotion
            )
        )

    def _read_layer(self, number: int, table: Mapping[str, Any]) -> None:
        where = f"[[layer]] {number}"
        plain = {key: value for key, value in table.items() if key not in IN_LAYER}
        told = self._table(where, LayerTable, plain)
        parts = {
            "positions": tuple(
                Position(**vars(one)) for one in self._inner(where, table, "position", PositionTable)
            ),
            "velocities": tuple(
                Velocity(**vars(one)) for one in self._inner(where, table, "velocity", VelocityTable)
            ),
            "couplings": tuple(
                Coupling(**vars(one)) for one in self._inner(where, table, "coupling", CouplingTable)
            ),
        }
        if "switch" in table:
            found = self._inner(where, table, "switch", SwitchTable)
            parts["switches"] = tuple(Switch(**vars(one)) for one in found)  # type: ignore[assignment]
        attributes = {field.name: getattr(told, field.name) for field in fields(told) if field.name != "take"}

        def play() -> None:
            self._project = play_take(self._project, self._name, self._take(told.take), **attributes, **parts)

        self._said(where, play)

    def _take(self, name: str) -> str:
        """The id of a take, the first where none is named."""
        if not self._takes:
            raise InputError("there is no take", mend='Say [[take]] file = "..." first.')
        if name and name not in self._takes:
            raise InputError(f"there is no take {name!r}", mend=f"Known: {', '.join(self._takes)}.")
        return name or next(iter(self._takes))

    @property
    def _puppet(self) -> Puppet:
        return self._project.puppets[self._name]

    def _put(self, puppet: Puppet) -> None:
        self._project = self._project.with_puppets(puppet)

    def _beside(self, file: str) -> Path:
        """A file's path, relative to the session's."""
        return self._path.parent / Path(os.path.expandvars(file)).expanduser()

    def _one(self, name: str, kind: type[T]) -> T:
        """A table there is one of; as usual where it is not there."""
        value = self._found.get(name, {})
        if not isinstance(value, Mapping):
            mend = f"Write [{name}], once."
            raise InputError(f"{name} must be one table", where=str(self._path), mend=mend)
        return self._table(f"[{name}]", kind, value)

    def _many(self, name: str, kind: type[T]) -> list[tuple[int, T]]:
        """Tables there may be several of, with their numbers from 1."""
        listed = enumerate(self._listed(name), 1)
        return [(number, self._table(f"[[{name}]] {number}", kind, one)) for number, one in listed]

    def _listed(self, name: str) -> list[Mapping[str, Any]]:
        return listed(self._found, name, str(self._path))

    def _inner(self, where: str, table: Mapping[str, Any], name: str, kind: type[T]) -> list[T]:
        """The tables of a kind in a layer."""
        found = enumerate(listed(table, name, f"{self._path}, {where}"), 1)
        return [self._table(f"{where}, {name} {number}", kind, one) for number, one in found]

    def _table(self, where: str, kind: type[T], value: Mapping[str, Any]) -> T:
        return load_settings(kind, value, where=f"{self._path}, {where}")

    def _said(self, where: str, step: Any, *arguments: Any) -> None:
        """Does a step; what it complains of is said to be in this table."""
        try:
            step(*arguments)
        except InputError as error:
            what = f"{error.where}: {error.what}" if error.where else error.what
            raise InputError(what, where=f"{self._path}, {where}", mend=error.mend) from None


def check_tables(found: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    """That there are no tables but these.

    Raises:
        InputError: which names the nearest known one.
    """
    for name in found:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            mend = f"Did you mean {near[0]}?" if near else f"Known: {', '.join(known)}."
            raise InputError(f"unknown table {name}", where=where, mend=mend)


def listed(found: Mapping[str, Any], name: str, where: str) -> list[Mapping[str, Any]]:
    """The tables of an array of tables; none where it is not there."""
    value = found.get(name, [])
    if not isinstance(value, list) or not all(isinstance(one, Mapping) for one in value):
        raise InputError(f"{name} must be tables", where=where, mend=f"Write [[{name}]] for each.")
    return value


def fitted(mesh: Mesh, table: MeshTable) -> Mesh:
    """The mesh as a session's table has it: upright, so tall, on the floor; from a project as it is there."""
    if Path(table.file).suffix.lower() != ".enliven" or table.height is not None or table.up != "y":
        axis = "xyz".index(table.up)
        height = table.height or float(np.ptp(mesh.vertices[:, axis]))
        mesh = fit_height(mesh, height, table.up)
    if table.turned:
        turn = from_rotation_vector(np.array([0.0, np.radians(table.turned), 0.0]))
        mesh = replace(mesh, vertices=rotate(turn, mesh.vertices))
    return mesh


def _mesh_of(path: Path, name: str) -> tuple[str, Mesh]:
    """The name and the mesh of a puppet of a project; of the first where none is named."""
    project = read_project(path)
    puppet = project.puppet(name or next(iter(project.puppets), ""))
    return puppet.id, puppet.mesh


def _nearest(mesh: Mesh, place: Float) -> int:
    """The vertex of a face that is nearest to a place (3,)."""
    used = np.unique(mesh.faces)
    return int(used[np.linalg.norm(mesh.vertices[used] - place, axis=1).argmin()])
