"""The scenes of a project at several times, for its contact sheet and its film."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.document import Character, Project, Props, SkinWeights
from enliven.errors import InputError
from enliven.meshes import Mesh
from enliven.modeling.edits import get_rig_edits
from enliven.person import Body
from enliven_viewer.render.scene import Scene, SceneCharacter, SceneStyle

_STYLE = SceneStyle(body=1.0, reveal=1.0, cues=0.0, graph=0.0, held=0.0)
"""Draws meshes and the performers inside them, without attachment points and graphs."""


class ProjectScenes:
    """Makes the scenes of a project, or of several versions of a project while it is edited.

    The :class:`Character` of a mesh is reused in all scenes unless its faces change, so the renderer uploads
    it once. The solver of a character is prepared once per version of the project.

    Args:
        reveal: transparency of a mesh around the performers inside it, from 0 to 1.
    """

    def __init__(self, reveal: float = 1.0) -> None:
        self._style = replace(_STYLE, reveal=reveal)
        self._characters: dict[str, Character] = {}
        self._surfaces: dict[str, tuple[Project, Callable[[float], Float]]] = {}

    def scene(
        self, project: Project, time: float, bodies: Sequence[Body] = (), props: Props | None = None
    ) -> Scene:
        """Returns all characters of a project at a time in seconds, with performers and loose objects.

        Raises:
            InputError: if a character has no mesh.
        """
        actors = tuple(self._scene_character(project, name, time) for name in project.characters)
        return Scene(actors, tuple(bodies), self._style, props)

    def _scene_character(self, project: Project, name: str, time: float) -> SceneCharacter:
        """Returns a character of a project at a time in seconds, with solved vertex positions."""
        if name not in self._surfaces or self._surfaces[name][0] is not project:
            character = project.character(name)
            self._surfaces[name] = project, get_rig_edits(character).create_surface_player(project, character)
        vertices = self._surfaces[name][1](time)
        drawn_character = self._make_drawn_character(project, name, vertices)
        return SceneCharacter(
            drawn_character, drawn_character.rest_pose(), vertices=vertices.astype(np.float32)
        )

    def _make_drawn_character(self, project: Project, name: str, vertices: Float) -> Character:
        """Returns the :class:`Character` to draw. It is a new object only if the faces of its mesh have
        changed.
        """
        mesh = project.character(name).mesh
        if mesh is None:
            raise InputError("it has no mesh", where=f"character {name!r}", remedy="Give it one.")
        drawn_character = self._characters.get(name)
        if drawn_character is None or drawn_character.faces is not mesh.faces:
            drawn_character = self._characters[name] = _convert_to_character(
                replace(mesh, vertices=vertices), name
            )
        return drawn_character


def _convert_to_character(mesh: Mesh, name: str) -> Character:
    """Returns a mesh as a character with a single transform."""
    count = len(mesh.vertices)
    weights = np.zeros((count, 4), np.float32)
    weights[:, 0] = 1.0
    return Character(
        id=name,
        vertices=mesh.vertices.astype(np.float32),
        faces=mesh.faces,
        skin=SkinWeights(np.zeros((count, 4), np.uint16), weights),
        pivots=np.zeros((1, 3), np.float32),
        edges=np.zeros((0, 2), np.int32),
        colours=mesh.colours,
        materials=mesh.materials,
    )
