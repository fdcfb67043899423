"""Hand-written sessions for example-based retargeting (TOML): a mesh, its control points, key poses and
layers.

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

    [[root]]                          # the puppet moves across the stage
    [[root.key]]
    second = 2.0
    metres = [1.5, 0.0, 0.0]

Positions are in metres in the frame of the fitted mesh: upright, standing on y = 0, bounding box centred.
File paths are relative to the session file. They may begin with an environment variable
("$MESHES/cactus.off"). All tables are in :mod:`enliven.example_sessions.tables`.
:func:`enliven.example_sessions.text.write_session` writes a session.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from enliven.document import ExampleCharacter, Plane, Project, RootLayer, clip_from_keys, unused
from enliven.errors import InputError
from enliven.example_sessions.file import SessionFile
from enliven.example_sessions.mesh import find_nearest_vertex, load_session_mesh
from enliven.example_sessions.tables import (
    INNER_TABLES,
    ROOT_INNER_TABLES,
    LayerTable,
    MeshTable,
    PointTable,
    PoseTable,
    PuppetTable,
    RootTable,
    SettingsTable,
    SymmetryTable,
    TakeTable,
)
from enliven.modeling.mesh.mirror_plane import plane_of_symmetry
from enliven.modeling.puppet.edits import make_puppet, play_take
from enliven.modeling.puppet.points import add_point, change_point
from enliven.modeling.puppet.poses import add_key_pose, set_symmetry
from enliven.motion_clips.take_files import read_take


@dataclass(frozen=True, eq=False)
class Session:
    """The content of a session file.

    Attributes:
        project: the project, with one puppet and the takes.
        puppet: the puppet's name.
        notes: sentences about unusual content of the files.
        mesh: the table with the path of the mesh's file.
        takes: the table with the path of each take's file, by the take's name.
    """

    project: Project
    puppet: str
    notes: tuple[str, ...]
    mesh: MeshTable
    takes: Mapping[str, TakeTable]


def read_session(path: Path | str) -> Session:
    """Reads a session from its file.

    Raises:
        InputError: if the file cannot be read, or a value is invalid. The message names the table and the
            key.
    """
    return _Reader(SessionFile(Path(path))).session()


class _Reader:
    """Builds a project from the tables of a session, table by table."""

    def __init__(self, file: SessionFile) -> None:
        self._file, self._project, self._name = file, Project(), ""
        self._notes: list[str] = []
        self._takes: dict[str, TakeTable] = {}

    def session(self) -> Session:
        """Reads the whole session."""
        file, mesh = self._file, self._file.read_table("mesh", MeshTable)
        file.locate_errors("[mesh]", self._read_mesh, mesh)
        for table_name, take in file.read_tables("take"):
            file.locate_errors(table_name, self._read_take, file.parse_table(table_name, TakeTable, take))
        for table_name, point in file.read_tables("point"):
            file.locate_errors(table_name, self._read_point, file.parse_table(table_name, PointTable, point))
        for table_name, pose in file.read_tables("pose"):
            file.locate_errors(table_name, self._read_pose, file.parse_table(table_name, PoseTable, pose))
        if file.has_table("symmetry"):
            file.locate_errors("[symmetry]", self._read_symmetry, file.read_table("symmetry", SymmetryTable))
        self._read_settings()
        for table_name, layer in file.read_tables("layer"):
            layer_table = file.parse_table(
                table_name, LayerTable, {k: v for k, v in layer.items() if k not in INNER_TABLES}
            )
            file.locate_errors(
                table_name,
                self._read_layer,
                layer_table,
                self._layer_contents(table_name, layer, INNER_TABLES),
            )
        for table_name, root in file.read_tables("root"):
            root_table = file.parse_table(
                table_name, RootTable, {k: v for k, v in root.items() if k not in ROOT_INNER_TABLES}
            )
            file.locate_errors(
                table_name,
                self._read_root,
                root_table,
                self._layer_contents(table_name, root, ROOT_INNER_TABLES),
            )
        return Session(self._project, self._name, tuple(self._notes), mesh, self._takes)

    def _read_mesh(self, table: MeshTable) -> None:
        puppet_table = self._file.read_table("puppet", PuppetTable)
        mesh, name, notes = load_session_mesh(table, self._file.resolve_path(table.file))
        self._notes += notes
        self._name = puppet_table.name or name
        self._project = make_puppet(self._project, mesh, self._name)
        self._store_puppet(
            self._puppet.with_changes(place=np.array(puppet_table.place), turn=np.array(puppet_table.turn))
        )

    def _read_take(self, table: TakeTable) -> None:
        path = self._file.resolve_path(table.file)
        clip, notes = read_take(path, table.animation, table.start, table.end)
        name = table.name or clip.id
        if name in self._takes:
            remedy = "Set another name for this take."
            raise InputError(f"the session already has a take {name!r}", where=str(path), remedy=remedy)
        self._project = self._project.with_takes(replace(clip, id=name))
        self._takes[name] = replace(table, name=name)
        self._notes += notes

    def _read_point(self, table: PointTable) -> None:
        vertex = table.vertex
        if (vertex is None) == (table.at is None):
            raise InputError(
                "the control point needs either a vertex or a position",
                remedy="Set vertex = 4711 or at = [x, y, z].",
            )
        if vertex is None:
            vertex = find_nearest_vertex(self._puppet.mesh, np.array(table.at))
        self._project = add_point(self._project, self._name, vertex, table.name, table.joint, table.foot)
        point = self._puppet.points[-1].name
        self._project = change_point(self._project, self._name, point, weight=table.weight)

    def _read_pose(self, table: PoseTable) -> None:
        take = self._find_take_id(table.take)
        if (table.time is None) == (table.frame is None):
            raise InputError(
                "the key pose needs either a time or a frame", remedy="Set time = 3.2 or frame = 96."
            )
        if table.places is not None and table.moves is not None:
            raise InputError("the key pose has both places and moves", remedy="Set only one of the two.")
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
                remedy = "Set a point and a normal in [symmetry], or remove [symmetry]."
                raise InputError("no symmetry plane of the mesh was found", remedy=remedy)
        self._project = set_symmetry(self._project, self._name, plane)

    def _read_settings(self) -> None:
        settings = self._file.read_table("settings", SettingsTable)
        self._store_puppet(
            self._puppet.with_changes(
                surface=settings.surface, examples=settings.examples, locomotion=settings.locomotion
            )
        )

    def _read_layer(self, table: LayerTable, asked: Mapping[str, Any]) -> None:
        attributes = {
            field.name: getattr(table, field.name) for field in fields(table) if field.name != "take"
        }
        self._project = play_take(
            self._project, self._name, self._find_take_id(table.take), **attributes, **asked
        )

    def _read_root(self, table: RootTable, asked: dict[str, Any]) -> None:
        keys, known_takes = asked.pop("keys", ()), [root.take for root in self._puppet.root_layers]
        name = table.take
        if keys:
            name = name or unused(f"{self._name} keys", self._project.takes)
            if name in self._project.takes:
                raise InputError(
                    f"the session already has a take {name!r}", remedy="Set another name for this take."
                )
            self._project = self._project.with_takes(clip_from_keys(name, "root", keys))
        elif name not in known_takes:
            name = self._find_take_id(name)
        values = {field.name: getattr(table, field.name) for field in fields(table) if field.name != "take"}
        values |= {key: np.array(values[key]) for key in ("about", "basis")}
        layer = RootLayer(take=name, **values, **asked)
        self._store_puppet(self._puppet.with_changes(root_layers=(*self._puppet.root_layers, layer)))

    def _layer_contents(
        self, table_name: str, layer: Mapping[str, Any], inside: Mapping[str, tuple[str, type]]
    ) -> dict[str, Any]:
        """Returns the attributes of a layer that are given by the tables inside its table, such as clips,
        keys, constraints and switches."""
        attributes = {}
        for name, (attribute, kind) in inside.items():
            if name in layer:
                attributes[attribute] = tuple(self._file.read_inner_tables(table_name, layer, name, kind))
        return attributes

    def _find_take_id(self, name: str) -> str:
        """Returns the ID of the take with a name, or of the first take if the name is empty."""
        if not self._takes:
            raise InputError("the session has no take", remedy='Add [[take]] with file = "PATH" first.')
        if name and name not in self._takes:
            raise InputError(
                f"the take {name!r} does not exist", remedy=f"Known takes: {', '.join(self._takes)}."
            )
        return name or next(iter(self._takes))

    @property
    def _puppet(self) -> ExampleCharacter:
        return self._project.puppets[self._name]

    def _store_puppet(self, puppet: ExampleCharacter) -> None:
        self._project = self._project.with_characters(puppet)
