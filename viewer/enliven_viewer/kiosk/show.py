"""The kiosk's show: turns the story, the edge and recorded performances into the scene of each picture."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from enliven.arrays import Float, Float32
from enliven.character_store.prepared import PreparedCharacter, prepare_once
from enliven.character_store.store import compute_cache_key
from enliven.deformation.graph.graph import DeformationGraph, character_from_graph
from enliven.document import Character
from enliven.kiosk.profile import KioskProfile
from enliven.kiosk.spot import Press
from enliven.kiosk.story import SpotView, Story, StoryInput, StoryView
from enliven.kiosk.story_table import Phase
from enliven.kiosk.visitors import Place
from enliven.person import Body, Joint
from enliven.possession import ActorSettings, body_yaw, prepare_for_actor
from enliven.samples.shipped import load_sample
from enliven_viewer.kiosk.carousel import Carousel
from enliven_viewer.kiosk.figures import STANDING_HEIGHT_M, CharacterFigure
from enliven_viewer.kiosk.floor_marks import FloorMark, SpotMark
from enliven_viewer.kiosk.performances import PerformanceCycle, SpotContent
from enliven_viewer.kiosk.stage_link import EdgeReport, KioskLink, find_parts
from enliven_viewer.render.camera import CameraView, OrbitCamera
from enliven_viewer.render.scene import Scene, SceneCharacter, SceneStyle

_SPOT_COLOURS = ((255, 196, 92), (96, 226, 222), (196, 160, 255), (150, 235, 130))
"""sRGB of the first, second, ... spot: the colours of performers, beginning with amber."""
_RING_COLOUR = (255, 255, 255)
"""sRGB of the progress ring. It is the brightest colour in the picture, so that it is visible across a room.
"""
_PULSE_PERIOD_S = 2.4
"""Period in seconds of the slow pulsation of the spot."""
GLOW_S = 3.0
"""Seconds for which the controlled parts of a character glow after a visitor has taken it."""
_REVEAL_TIME_S = 0.25
"""Time constant in seconds with which skeletons fade in and out."""
_DRIFT_YAW = math.radians(4.0)
"""Amplitude of the camera's drift in radians. It moves every edge in the picture by many pixels to prevent
burn-in.
"""
_DRIFT_PERIOD_S = 47.0
"""Period of the camera's drift in seconds: too slow to distract."""
_CAMERA_ELEVATION = math.radians(9.0)
"""Elevation of the camera in radians. The spot on the floor is visible, and the view resembles that of a
mirror at eye level.
"""
_MIN_HALF_WIDTH_M = 0.85
"""Minimum distance in metres from an outer spot to the border of the view: room for an outstretched arm."""
_MAX_HALF_WIDTH_M = 1.4
"""Maximum distance in metres from an outer spot to the border of the view. A wider view would make the
character too small.
"""
_VIEW_BORDER_M = 0.35
"""Minimum distance in metres from visitors' hips to the border of the view."""
_VIEW_TIME_S = 0.8
"""Time constant in seconds with which the view widens for visitors and characters."""
_VIEW_HEIGHT_M = 2.15
"""Height in metres of the visible space above the floor: a tall visitor with raised hands."""
_VIEW_DEPTH_M = 0.32
"""Height in metres of the visible space below the floor: room for captions below the spot."""
_VIEW_MARGIN = 1.1
"""Size of the view relative to the box of the visible space. The margin leaves room for the title."""
_LOOKING_DISTANCE_M = 0.9
"""Assumed distance in metres of a visitor to whom a character turns. A short distance makes the turn large
enough to be noticed.
"""
_SPARE_NODES = 128
"""Number of graph nodes of the shipped character that is shown until the edge answers. The edge's characters
have the same number.
"""
_IDLE_SWAY = math.radians(9.0)
"""Amplitude of the turns of a character that waits without visitors, in radians."""


@dataclass(frozen=True)
class ShowFrame:
    """All data of one picture.

    Attributes:
        scene: what is drawn in 3D.
        story: the state of the story.
        character: name of the character that the captions mention.
        now: seconds since the start, on the clock of the story.
        report: the state of the edge.
    """

    scene: Scene
    story: StoryView
    character: str
    now: float = 0.0
    report: EdgeReport = field(default_factory=EdgeReport)


class KioskShow:
    """The show of one kiosk.

    Args:
        profile: the kiosk's profile.
        folder: folder of the profile, for relative paths.
        link: the connection to the edges; None makes one.

    Attributes:
        camera: the camera, which looks from the screen towards the visitors.
    """

    def __init__(self, profile: KioskProfile, folder: Path, link: KioskLink | None = None) -> None:
        self._profile, zone, story = profile, profile.zone, profile.story
        names = list(profile.characters)
        self._link = link or KioskLink(profile, folder)
        self._story = Story(story, zone, names)
        self._now = 0.0
        self._view = self._story.advance(StoryInput(0.0, is_connected=False))
        count = len(self._view.spots)
        paths = [folder / path for path in story.attract]
        place = self._view.spots[0].place
        self._programme = PerformanceCycle(paths, find_parts(profile), place, zone.spot, story.dwell, names)
        self._figures: dict[tuple[int, str], CharacterFigure] = {}
        self._spot_marks = [
            SpotMark(k, _SPOT_COLOURS[k % len(_SPOT_COLOURS)], _RING_COLOUR) for k in range(count)
        ]
        self._next_mark = FloorMark("next visitor", _RING_COLOUR)
        self._carousel = Carousel()
        self._background = ThreadPoolExecutor(1, "kiosk spare character")
        self._spare = self._background.submit(make_spare_character, profile)
        self._skeletons = 0.0
        self._half_width = _MIN_HALF_WIDTH_M
        self.camera = OrbitCamera()

    @property
    def problems(self) -> list[str]:
        """Returns one sentence for operators for each recording that cannot be played."""
        return self._programme.problems

    def advance(self, seconds: float, presses: Sequence[Press] = ()) -> ShowFrame:
        """Advances the show by one picture.

        Args:
            seconds: time since the last picture.
            presses: buttons that were pressed at this computer.
        """
        self._now += seconds
        report = self._link.advance(seconds)
        self._view = self._story.advance(
            StoryInput(
                self._now,
                report.visitors,
                (*presses, *report.presses),
                report.holders,
                frozenset(report.characters),
                report.is_connected,
                self._programme.character,
            )
        )
        self._link.send(self._view.requests)
        characters = {
            name: report.characters[name] for name in self._list_available_characters(report)
        } or self._find_spare()
        self._programme.update_characters(characters)
        acts = self._find_acts(report, seconds)
        scene = self._make_scene(acts, characters, report, seconds)
        name = acts[self._view.shown].character
        return ShowFrame(scene, self._view, name, self._now, report)

    def get_camera_view(self, aspect: float) -> CameraView:
        """Returns the camera's view, which drifts slowly.

        Args:
            aspect: width over height of the picture.
        """
        places = np.array([spot.place for spot in self._view.spots])
        low, high = places.min(0), places.max(0)
        box = (
            np.array([low[0] - self._half_width, -_VIEW_DEPTH_M, low[1] - 0.3]),
            np.array([high[0] + self._half_width, _VIEW_HEIGHT_M, high[1] + 0.3]),
        )
        phase = 2 * math.pi * self._now / _DRIFT_PERIOD_S
        self.camera.face(
            _DRIFT_YAW * math.sin(phase), _CAMERA_ELEVATION + 0.25 * _DRIFT_YAW * math.cos(phase)
        )
        self.camera.frame(box, aspect, at_once=True, margin=_VIEW_MARGIN * (1 + 0.02 * math.sin(0.6 * phase)))
        return self.camera.view(aspect)

    def close(self) -> None:
        """Ends the link and the work in the background."""
        self._background.shutdown(wait=False, cancel_futures=True)
        self._programme.close()
        self._link.close()

    def _find_spare(self) -> Mapping[str, Character]:
        """Returns the shipped character that is shown until the edge sends its own. Returns an empty mapping
        while that character is being prepared.
        """
        return self._spare.result() if self._spare.done() and not self._spare.exception() else {}

    def _list_available_characters(self, report: EdgeReport) -> list[str]:
        """Returns the names of the profile's characters that are on the stage."""
        return [name for name in self._profile.characters if name in report.characters]

    def _find_acts(self, report: EdgeReport, seconds: float) -> list[SpotContent]:
        """Returns the content of each spot: recorded performances without visitors, otherwise the story."""
        if all(spot.phase is Phase.ATTRACT for spot in self._view.spots):
            first = self._programme.advance(seconds)
            rest = [SpotContent(spot.character) for spot in self._view.spots[1:]]
            return [first, *(act for act in rest if act.character != first.character)]
        self._programme.stop()
        return [self._find_act(spot, report) for spot in self._view.spots]

    def _find_act(self, spot: SpotView, report: EdgeReport) -> SpotContent:
        """Returns the content of a spot while there are visitors."""
        body = report.bodies.get(spot.body)
        if spot.phase is Phase.POSSESSED:
            return SpotContent(spot.character, body, 0.0, report.shown.get(spot.character), "edge")
        return SpotContent(spot.character, body, spot.ring, source="waits")

    def _make_scene(
        self, acts: list[SpotContent], characters: Mapping[str, Character], report: EdgeReport, seconds: float
    ) -> Scene:
        """Returns the scene of a picture."""
        actors: list[SceneCharacter] = []
        for k, act in enumerate(acts):
            spot = self._view.spots[k]
            actors += self._draw_spot(k, act, spot)
            character = characters.get(act.character)
            if character is None and act.driven is not None:
                character = act.driven.character
            if character is not None:
                shown = self._show_figure(k, act, character, spot, seconds)
                actors += [shown, *act.others]
        shown = {act.character for act in acts[1:]}
        actors += self._draw_carousel({k: v for k, v in characters.items() if k not in shown}, seconds)
        bodies = self._find_shown_bodies(acts, report, seconds)
        self._widen_view(
            [*(actor.extent for actor in actors), *(body.joints[:1] for body in bodies)], seconds
        )
        glow = any(s.phase is Phase.POSSESSED and self._now - s.since_s < GLOW_S for s in self._view.spots)
        style = SceneStyle(
            body=self._skeletons, reveal=self._skeletons, cues=0.0, graph=0.0, held=float(glow)
        )
        actors += self._draw_next_mark(report)
        return Scene(tuple(actors), bodies, style)

    def _widen_view(self, extents: Sequence[Float | Float32], seconds: float) -> None:
        """Widens the view gradually until it shows figures and visitors, within limits."""
        left, right = (self._view.spots[k].place[0] for k in (0, -1))
        reach = [max(left - e[:, 0].min(), e[:, 0].max() - right) for e in extents if np.isfinite(e).all()]
        wanted_half_width = min(
            max([_MIN_HALF_WIDTH_M, *(r + _VIEW_BORDER_M for r in reach)]), _MAX_HALF_WIDTH_M
        )
        self._half_width += (wanted_half_width - self._half_width) * -math.expm1(-seconds / _VIEW_TIME_S)

    def _show_figure(
        self, k: int, act: SpotContent, character: Character, spot: SpotView, seconds: float
    ) -> SceneCharacter:
        """Returns the character of a spot, turned to its visitor or driven."""
        figure = self._figures.setdefault((k, act.character), CharacterFigure(spot.place))
        yaw, height = _IDLE_SWAY * math.sin(0.5 * self._now + k), STANDING_HEIGHT_M
        if act.body is not None:
            yaw, height = _find_yaw(spot.place, act.body, self._profile.zone.spot), act.body.height
        figure.turn_to(spot.place, yaw, height, seconds)
        is_live = act.source == "edge"
        performer = _find_place(act.body) if is_live and act.body is not None else None
        return figure.show(character, act.driven, act.source, seconds, performer)

    def _draw_spot(self, k: int, act: SpotContent, spot: SpotView) -> list[SceneCharacter]:
        """Returns the marks of a spot. While a visitor performs there, it has no marks."""
        if spot.phase is Phase.POSSESSED or (act.driven is not None and spot.phase is Phase.ATTRACT):
            return []
        pulse = math.sin(2 * math.pi * self._now / _PULSE_PERIOD_S)
        return self._spot_marks[k].draw(spot.place, self._profile.zone.spot, act.ring, pulse)

    def _draw_next_mark(self, report: EdgeReport) -> list[SceneCharacter]:
        """Returns the mark around the feet of the next waiting visitor, while the current visitor is seen
        off.
        """
        body = report.bodies.get(self._view.queue[0]) if self._view.queue else None
        if self._view.phase is not Phase.FAREWELL or body is None:
            return []
        wave = 0.5 + 0.5 * math.sin(2 * math.pi * self._now)
        return [self._next_mark.make_mark(_find_place(body), 0.26 + 0.06 * wave, 0.32 + 0.06 * wave)]

    def _draw_carousel(self, characters: Mapping[str, Character], seconds: float) -> list[SceneCharacter]:
        """Returns the neighbours of the offered character, while a visitor may choose.

        Args:
            characters: the characters that no other spot shows, because the renderer draws each character
                only once.
        """
        spot = self._view.spots[0]
        chooses = len(self._view.spots) == 1 and spot.phase in (Phase.CHOOSE, Phase.NOTICED, Phase.DWELL)
        chooses = chooses and bool(self._profile.story.choose)
        names = [name for name in self._profile.characters if name in characters]
        return self._carousel.draw(
            names, characters, spot.character, spot.place, open=chooses, seconds=seconds
        )

    def _find_shown_bodies(
        self, acts: list[SpotContent], report: EdgeReport, seconds: float
    ) -> tuple[Body, ...]:
        """Returns the skeletons to show: those of waiting visitors, and those inside waiting characters."""
        farewells = {k for k, spot in enumerate(self._view.spots) if spot.phase is Phase.FAREWELL}
        waits = [
            act.body
            for k, act in enumerate(acts)
            if act.body is not None and act.driven is None and k not in farewells
        ]
        waits += [report.bodies[body] for body in self._view.queue if body in report.bodies]
        goal = 1.0 if waits else 0.0
        self._skeletons += (goal - self._skeletons) * -math.expm1(-seconds / _REVEAL_TIME_S)
        shown = waits
        if not waits and self._skeletons > 0.02:
            # Fade out the skeleton of the visitor who has just taken the character, inside the character.
            shown = [act.body for act in acts if act.body is not None]
        unique = {body.id: body for body in shown if np.isfinite(body.joints).all()}
        return tuple(unique[key] for key in sorted(unique))


def _find_place(body: Body) -> Place:
    """Returns the point of the floor under a body's hips."""
    x, z = body.joints[Joint.HIP_CENTER, [0, 2]]
    return float(x), float(z)


def _find_yaw(place: Place, body: Body, radius: float) -> float:
    """Returns the yaw in radians of a waiting character. The character looks out of the screen towards its
    visitor, like a mirror image. If the visitor is on the spot, it faces in the visitor's direction.
    """
    x, z = _find_place(body)
    if math.hypot(x - place[0], z - place[1]) <= radius:
        return body_yaw(body)
    return math.atan2(x - place[0], _LOOKING_DISTANCE_M)


def make_spare_character(profile: KioskProfile) -> dict[str, Character]:
    """Returns a shipped character, which is shown until the edge has sent its own."""
    names = [name for name, character in profile.characters.items() if character.mesh in ("chair", "lamp")]
    name = names[0] if names else next(iter(profile.characters), "chair")
    mesh = profile.characters[names[0]].mesh if names else "chair"
    sample: Literal["chair", "lamp"] = "lamp" if mesh == "lamp" else "chair"
    key = compute_cache_key("spare character", sample, name, _SPARE_NODES)
    return {name: prepare_once(key, lambda: _prepare_spare(sample, name)).character}


def _prepare_spare(sample: Literal["chair", "lamp"], name: str) -> PreparedCharacter:
    """Prepares the mesh of a shipped sample as a character."""
    mesh, settings, size, height = prepare_for_actor(load_sample(sample), ActorSettings())
    character = character_from_graph(mesh, DeformationGraph.build(mesh, nodes=_SPARE_NODES), name)
    return PreparedCharacter(character, settings, size, height, None)
