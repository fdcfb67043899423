"""Moving and merging possessed meshes: they have no root to drop, so Shift says that two become one."""

from __future__ import annotations

from enliven.arrays import Float
from enliven.document import Project
from enliven.modeling.possessed import merge_graphs, move_graph
from enliven_viewer.studio.editor import Editor
from enliven_viewer.studio.tools.base import Pointer
from enliven_viewer.studio.viewport import possessed_at


class GraphDrag:
    """A possessed mesh that :class:`~enliven_viewer.studio.tools.carry.CarryTool` drags."""

    def __init__(self, editor: Editor, graph: str, at: Float, start: Pointer) -> None:
        self.editor, self.graph, self._at, self._start = editor, graph, at, start

    @classmethod
    def of(cls, editor: Editor, pointer: Pointer) -> GraphDrag | None:
        """The drag of the possessed mesh under the pointer; None where none is."""
        hit = possessed_at(editor.possessed, editor.lens, pointer.at)
        if hit is None:
            return None
        editor.select(graph=hit[0])
        return cls(editor, hit[0], editor.lens.view.eye + hit[1] * editor.lens.ray(pointer.at), pointer)

    def moved(self, project: Project, pointer: Pointer) -> Project:
        """The project with the mesh as far as the pointer went."""
        lens = self.editor.lens
        return move_graph(project, self.graph, lens.on_plane(pointer.at, self._at) - self._at)

    def drop(self, pointer: Pointer) -> None:
        """Let go: there, or with Shift as one with the mesh that is under the pointer."""
        editor, time = self.editor, self.editor.time
        others = [mesh for mesh in editor.possessed if mesh.shape.id != self.graph]
        under = possessed_at(others, editor.lens, pointer.at) if pointer.shift else None
        if under is None:
            editor.edit(f"move {self.graph}", lambda project: self.moved(project, pointer))
            return
        host, notes = under[0], list[str]()

        def change(project: Project) -> Project:
            return merge_graphs(self.moved(project, pointer), host, self.graph, time, notes=notes)

        if editor.edit(f"merge {self.graph}", change):
            editor.select(graph=host)
            editor.toasts.say(f"{self.graph} is now part of {host}", *notes[:1])
