"""Registers the tour: its action, its card over the panels, and the check of its steps."""

from __future__ import annotations

from enliven_viewer.studio.actions.action import Action
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.app.panel_layout import PanelLayout
from enliven_viewer.studio.features.tour.tour import Tour


def register(app: App) -> None:
    """Registers the tour."""
    guide = app.add_state(TourGuide(app))

    # The drawing module is imported late, so that a workspace without a window works without ImGui.
    def draw_card(places: PanelLayout) -> None:
        from enliven_viewer.studio.features.tour.panel import draw_tour

        draw_tour(app, guide.tour, places, guide.end)

    action = Action(
        "help.tour",
        "Help",
        "Take the tour",
        (),
        guide.begin,
        about="Make a chair dance, cut off a leg, and save it. You can leave the tour and resume it later.",
    )
    app.actions.add(action, after="help.palette")
    app.window_overlays.append(draw_card)
    app.frame_tasks.append(lambda: guide.check_progress(app.frame.elapsed_s, app.frame.view[:2]))
    app.activity_checks.append(lambda: guide.tour is not None and guide.tour.is_moving)
    app.input_blocks.append(lambda: guide.tour is not None and guide.tour.demonstration is not None)
    app.wants_start_page = lambda: None if guide.tour is None else guide.tour.wants_samples


class TourGuide:
    """Starts, resumes and ends the tour.

    Attributes:
        tour: the running tour; None without one.
    """

    def __init__(self, app: App) -> None:
        self._app = app
        self.tour: Tour | None = None

    def begin(self) -> None:
        """Starts the tour, or resumes it at the last step. Restarts a running tour."""
        app = self._app
        number = 0 if self.tour is not None else app.preferences.tour_step
        app.starting, self.tour = False, Tour(app, app.drawn, number)

    def check_progress(self, seconds: float, origin: tuple[float, float] = (0.0, 0.0)) -> None:
        """Lets the tour check the current step. Call once per frame.

        Args:
            seconds: time since the last frame.
            origin: the top left corner of the image, in the window's pixels.
        """
        if self.tour is None:
            return
        self.tour.check_progress(seconds, origin)
        number, preferences = 0 if self.tour.step is None else self.tour.number, self._app.preferences
        if number != preferences.tour_step:
            preferences.tour_step = number
            preferences.save()

    def end(self) -> None:
        """Closes the tour, which can be resumed later."""
        preferences = self._app.preferences
        if self.tour is not None:
            self.tour.restore_state()
        self.tour, preferences.toured = None, True
        preferences.save()
