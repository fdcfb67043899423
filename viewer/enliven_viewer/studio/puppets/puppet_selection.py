"""The selection of puppet and control point, and the creation of control points on the mesh."""

from __future__ import annotations

import numpy as np

from enliven.document import ExampleCharacter, Project
from enliven.modeling.puppet.points import add_point
from enliven_viewer.language import later, tr
from enliven_viewer.studio.editor.editor import Editor
from enliven_viewer.studio.puppets.puppet_stage import PuppetStage, StagePuppet
from enliven_viewer.studio.puppets.solver import MIN_BACKGROUND_VERTICES
from enliven_viewer.studio.puppets.symmetry import find_partner_vertex, find_plane


class PuppetSelection:
    """The selected puppet and control point, with the command that adds control points.

    Attributes:
        stage: the puppets in their current poses.
        symmetric: whether control points are added and dragged symmetrically.
    """

    def __init__(self, editor: Editor, stage: PuppetStage) -> None:
        self.editor, self.stage = editor, stage
        self.symmetric = False

    @property
    def stage_puppets(self) -> tuple[StagePuppet, ...]:
        """Returns every puppet in its current pose."""
        return self.stage.puppets

    @property
    def puppet(self) -> ExampleCharacter | None:
        """Returns the selected puppet."""
        return self.editor.find_selected(ExampleCharacter)

    @property
    def point(self) -> int | None:
        """Returns the number of the selected control point."""
        return None if self.puppet is None else self.editor.selection.handle

    @property
    def stage_puppet(self) -> StagePuppet | None:
        """Returns the selected puppet in its current pose."""
        return None if self.puppet is None else self.stage.find(self.puppet.id)

    def add_point(self, vertex: int) -> bool:
        """Adds a control point at a vertex, with symmetry also at its mirror image, as one edit."""
        puppet = self._selected_puppet()
        if puppet is None:
            return False
        taken_vertices = [point.vertex for point in puppet.points]
        if vertex in taken_vertices:
            self.editor.select_only(puppet.id, taken_vertices.index(vertex))
            self.editor.toasts.show_message(
                tr("{0} exists already", puppet.points[taken_vertices.index(vertex)].name)
            )
            return False
        other = find_partner_vertex(puppet, vertex) if self.symmetric else None
        new_vertices = [vertex] if other is None or other in (vertex, *taken_vertices) else [vertex, other]

        poses = self.stage.surfaces.settle_each(puppet, [pose.places for pose in puppet.poses])
        if poses is None and len(puppet.mesh.vertices) > MIN_BACKGROUND_VERTICES:
            self.editor.toasts.show_message(
                tr("{0} is still being prepared", puppet.id), tr("Click again in a moment.")
            )
            return False

        def change(project: Project) -> Project:
            for new_vertex in new_vertices:
                places = (
                    None if poses is None else np.array([pose[new_vertex] for pose in poses]).reshape(-1, 3)
                )
                project = add_point(project, puppet.id, new_vertex, places=places)
            return project

        if not self.editor.edit(
            later("put a control point") if len(new_vertices) == 1 else later("put control points"), change
        ):
            return False
        self.editor.select_only(puppet.id, len(taken_vertices))
        return True

    def set_symmetric(self, on: bool) -> None:
        """Turns symmetric editing of control points on or off. Shows a message if the mesh has no plane of
        symmetry.
        """
        puppet = self.puppet
        self.symmetric = on
        if on and puppet is not None and find_plane(puppet) is None:
            self.symmetric = False
            self.editor.toasts.show_message(
                tr("{0} has no plane of symmetry", puppet.id),
                tr("Put and drag its control points one by one."),
            )

    def _selected_puppet(self) -> ExampleCharacter | None:
        if self.puppet is None:
            self.editor.toasts.show_message(tr("No puppet is chosen"), tr("Click a puppet first."))
        return self.puppet
