"""Estimates the floor from the people in view, by average body proportions, if no floor is visible."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from enliven.kernels import quantile
from enliven_edge.tracking.frame.observation import FrameView
from enliven_edge.tracking.people.person import Person
from enliven_edge.tracking.people.search import person_probability
from enliven_edge.tracking.scene.background_model import BackgroundModel
from enliven_edge.tracking.segment.candidate import MAX_YOUNG_AGE_S, Candidate
from enliven_edge.tracking.segment.candidates import Candidates
from enliven_edge.tracking.segment.segmentation import segment_people
from enliven_edge.tracking.settings import TrackerSettings

_MIN_STEP_M = 0.1
"""Minimum correction of the guessed floor in metres while no person is tracked. Smaller corrections would
only follow noise."""
_MIN_PERSON_AREA_M2 = 0.14
"""Minimum visible area in square metres of a blob that is used to guess the floor: a head and a chest."""
_MAX_TRIED = 3
"""Maximum number of blobs per frame that the network classifies, the likeliest first."""
_MIN_PROBABILITY = 0.8
"""Minimum probability, according to the network, that a blob is a person. Nearly all people exceed 0.85."""
_MAX_OCCLUDED = 0.1
"""Maximum occluded fraction of a blob's outline for its lowest pixels to count as feet."""
_SOLE_QUANTILE = 0.01
"""Quantile of the heights of a person's pixels that is used as the height of the soles. Lower pixels are
noise."""
_MIN_HEIGHT_M = 0.9
"""Minimum height of the visible pixels of a whole standing person: a small child."""
_MAX_HEIGHT_M = 2.1
"""Maximum height of the visible pixels of a whole standing person. Raised arms reach higher."""
_SETTLING_FRAMES = 90
"""Number of frames after the first detection in which the guessed floor follows the soles, until the bone
lengths settle."""
_GAIN = 0.1
"""Fraction of the correction that is applied in each of these frames, to average out the noise of single
frames."""


class FloorEstimator:
    """Estimates the error of the guessed sensor height from the visible people.

    A person who is visible down to the feet stands on the floor. A person who extends beyond the lower
    image border is assumed to have average height until the bones are measured. After that the floor is
    placed at the soles of the fitted body, because the body's proportions predict the length of unseen legs.
    """

    def __init__(self, settings: TrackerSettings) -> None:
        self._settings = settings
        self._frames = 0

    def correct_before_search(self, view: FrameView, background: BackgroundModel) -> float:
        """Returns the correction of the world's height in metres, from the first likely person.

        Call it in frames without tracked people.
        """
        self._frames = 0
        scene = self._settings.scene
        kind = background.classify(view, scene.near, scene.far, scene.floor_band)
        groups = segment_people(view, kind, [])
        young = background.age < MAX_YOUNG_AGE_S
        candidates = Candidates().update(view, kind, groups, lambda _: True, lambda _: False, young=young)
        people = [
            candidate
            for candidate in candidates
            if candidate.shape.has_person_shape and candidate.area > _MIN_PERSON_AREA_M2
        ]
        for group in people[:_MAX_TRIED]:
            step = self._height_correction(group, view)
            if self._is_person(view.raise_by(step), group):
                return step if abs(step) > _MIN_STEP_M else 0.0
        return 0.0

    def _is_person(self, view: FrameView, group: Candidate) -> bool:
        """Returns True if a blob looks like a person, after the floor was guessed from it."""
        if not self._settings.estimator:
            return group.shape.is_upright
        return person_probability(view, group.pixels) > _MIN_PROBABILITY

    def _height_correction(self, person: Candidate, view: FrameView) -> float:
        """Returns the height correction in metres. With it, the blob is a person who stands on the floor."""
        shape = person.shape
        lowest = float(quantile(np.sort(view.points[..., 1][person.pixels]), _SOLE_QUANTILE))
        whole = not shape.is_cut_off and shape.occluded_fraction < _MAX_OCCLUDED
        if whole and _MIN_HEIGHT_M < shape.crown - lowest < _MAX_HEIGHT_M:
            return -lowest
        return self._settings.body_height - shape.crown

    def correct_after_fit(self, people: Iterable[Person]) -> float:
        """Returns the correction of the world's height in metres, from the soles of the tracked people."""
        soles = [person.follower.posture.lowest for person in people if not person.is_hidden]
        if not soles or self._frames > _SETTLING_FRAMES:
            return 0.0
        self._frames += 1
        return -float(np.median(soles)) * (1.0 if self._frames == 1 else _GAIN)
