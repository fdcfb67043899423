"""The panels of the edited puppet: its performer, the strip of key poses, and its options."""

from __future__ import annotations

from collections.abc import Callable

from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.panel_layout import Area
from enliven_viewer.studio.features.perform.session import PerformSession
from enliven_viewer.studio.features.puppets.performer_picture import PerformerPicture
from enliven_viewer.studio.features.puppets.performer_view import PerformerView
from enliven_viewer.studio.features.puppets.thumbnails import Thumbnails
from enliven_viewer.studio.puppets.puppet_editor import get_puppet_editor
from enliven_viewer.studio.viewport.viewport import Viewport


class PuppetPanels:
    """Draws the panels of the edited puppet, and owns their images.

    Their drawing modules are imported late, so that a workspace without a window works without ImGui.
    """

    def __init__(self, app: App, view: PerformerView) -> None:
        self._app, self._view = app, view
        self._performer: PerformerPicture | None = None
        self._thumbnails: Thumbnails | None = None

    def is_shown(self) -> bool:
        """Returns True if a puppet is being edited, so that its performer and key poses are shown."""
        app, editor = self._app, self._app.editor
        return (
            get_puppet_editor(editor).puppet is not None
            and app.state(PerformSession).active_workspace in ("Animate", "Model")
            and not app.input.tool.hides_performer
            and not editor.selection.has_several
        )

    def make_pictures(self, view: Viewport) -> Callable[[], object]:
        """Returns the function that draws the images of the panels, once per frame."""
        from enliven_viewer.studio.app.style import convert_to_screen_pixels

        renderer = view.renderer
        surfaces = get_puppet_editor(self._app.editor).stage.surfaces
        performer = self._performer = PerformerPicture(renderer)
        thumbnails = self._thumbnails = Thumbnails(renderer.ctx, surfaces)

        def draw() -> None:
            if not self.is_shown():
                return
            self._view.update()
            thumbnails.draw_next()
            figure = self._view.figure()
            if figure is not None:
                renderer.resize(convert_to_screen_pixels(*self._view.size))
                performer.draw(figure, self._view.lens, self._view.paired(), self._view.hovered)

        return draw

    def draw_performer(self, area: Area) -> None:
        """Draws the second view."""
        from enliven_viewer.studio.features.puppets.performer_panel import draw_performer

        texture = None if self._performer is None else self._performer.renderer.picture.texture.glo
        draw_performer(self._app, area, texture)

    def draw_strip(self, area: Area) -> None:
        """Draws the strip of key poses."""
        from enliven_viewer.studio.features.puppets.pose_strip import draw_strip

        if self._thumbnails is not None:
            draw_strip(self._app, area, self._thumbnails)

    def draw_options(self, area: Area) -> None:
        """Draws the options of the puppet."""
        from enliven_viewer.studio.features.puppets.examples_panel import draw_examples

        draw_examples(self._app, area)
