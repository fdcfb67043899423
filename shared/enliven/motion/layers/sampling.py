"""Samples all layers of a shape together, for :class:`enliven.motion.layers.evaluate.Player`.

    sampler = Sampler(project, shape)
    sampler.knots(times) -> (T, K, 4)        # rotations at the joints of every layer's chain, target's basis
    sampler.animation_rotations(knots) -> (T, N, 4)     # a_j of every bone
    sampler.feed(take, turns)                # a live frame instead of a take

Values that are constant over time are computed only once, for example the knots next to a position on a bone.
"""

from __future__ import annotations

from itertools import groupby, pairwise

import numpy as np

from enliven.arrays import Float, Int32
from enliven.document import Layer, Project, RiggedCharacter, smooth_take
from enliven.motion.kinematics.composing import own_turns
from enliven.motion.layers.polyline import Polyline, blend_knots, knot_turns, locate_on_knots
from enliven.motion.layers.timing import LayerClocks


class Sampler:
    """The active layers of a shape, arranged in arrays for the kernels.

    Attributes:
        layers: the layers that rotate bones, grouped by take. Muted layers and layers of weight 0 are left
            out.
        lines: the polyline of each layer.
        parts: the slice of each layer in the K knots of all layers.
    """

    def __init__(self, project: Project, shape: RiggedCharacter) -> None:
        self.layers: list[Layer] = sorted(active_layers(shape), key=_sampling_group)
        takes = [smooth_take(project.takes[layer.take], layer.smooth) for layer in self.layers]
        self.lines = [
            Polyline.from_clip(take, layer.chain) for take, layer in zip(takes, self.layers, strict=True)
        ]
        knot_bounds = np.cumsum([0, *(len(line.knots) for line in self.lines)]).tolist()
        self.parts = [slice(a, b) for a, b in pairwise(knot_bounds)]
        self._takes = [
            _TakeLayers(layer_numbers, self.layers, self.lines, knot_bounds[layer_numbers[0]])
            for _, group in groupby(range(len(self.layers)), key=lambda i: _sampling_group(self.layers[i]))
            for layer_numbers in [list(group)]
        ]
        self._count = knot_bounds[-1]
        self._lay_out(shape)

    def knots(self, times: Float) -> Float:
        """Returns the rotations (T, K, 4) at all knots of all layers at times (T,), in the target's basis."""
        rotations = np.empty((len(times), self._count, 4))
        for take in self._takes:
            take.sample(times, rotations)
        return rotations

    def weights(self, times: Float) -> Float:
        """Returns the fade weight (T, L) of each layer at times (T,). It is below 1 while a layer fades in or
        out.
        """
        fade_weights = np.empty((len(times), len(self.layers)))
        for take in self._takes:
            fade_weights[:, take.numbers] = take.weights(times)
        return fade_weights

    def animation_rotations(self, knots: Float) -> Float:
        """Returns the animation rotations a_j (T, N, 4) of the bones."""
        rotations = np.empty((len(knots), len(self._first) - 1, 4))
        own_turns(
            knots, self._knot, self._part, self._fixed, self._first, self._terms, self._inverse, rotations
        )
        return rotations

    def feed(self, take: str, turns: Float) -> None:
        """Replaces a take by the live frame ``turns`` (1, N, 4) at all times."""
        for take_layers in self._takes:
            if take_layers.id == take:
                take_layers.fed = turns

    def _lay_out(self, shape: RiggedCharacter) -> None:
        """Converts the spans of each bone to a sequence of factors: samples of q, or their inverses.

        A span with layers 1 and 2 is C(0)^-1 C(1) = q2(a2)^-1 q1(a1)^-1 q1(b1) q2(b2). A sample that is used
        both at the end of a bone and at the start of the next bone is computed only once. Fixed rotations
        before spans get the numbers -1, -2, ...
        """
        number = {layer.id: i for i, layer in enumerate(self.layers)}
        samples: dict[tuple[int, float], int] = {}
        fixed: list[tuple[float, ...]] = []
        terms: list[tuple[int, bool]] = []
        first = [0]
        for spans in shape.spans:
            for span in spans:
                if span.before != (1.0, 0.0, 0.0, 0.0):
                    fixed.append(span.before)
                    terms.append((-len(fixed), False))
                active_refs = [ref for ref in span.refs if ref.layer in number and ref.start != ref.end]
                for ref in reversed(active_refs):
                    terms.append((samples.setdefault((number[ref.layer], ref.start), len(samples)), True))
                for ref in active_refs:
                    terms.append((samples.setdefault((number[ref.layer], ref.end), len(samples)), False))
            first.append(len(terms))
        self._first, self._fixed = np.array(first, np.int32), np.array(fixed, np.float64).reshape(-1, 4)
        self._terms = np.array([term for term, _ in terms], np.int32)
        self._inverse = np.array([inverse for _, inverse in terms], np.bool_)
        self._knot, self._part = self._knots_and_fractions(list(samples))

    def _knots_and_fractions(self, samples: list[tuple[int, float]]) -> tuple[Int32, Float]:
        """Returns the knot (M,) of each sample in the knots of all layers, and the fraction (M,) of the way
        to the next knot.
        """
        knot, fraction = np.empty(len(samples), np.int32), np.empty(len(samples))
        layer_numbers = np.array([layer for layer, _ in samples], np.int32)
        s = np.array([position for _, position in samples], np.float64)
        for layer in set(layer_numbers.tolist()):
            is_layer = layer_numbers == layer
            local_knot, fraction[is_layer] = locate_on_knots(self.lines[layer].knots, s[is_layer])
            knot[is_layer] = self.parts[layer].start + local_knot
        return knot, fraction


class _TakeLayers:
    """The layers of one take, with their indices ``numbers`` in all layers, and the index ``begin`` of their
    first knot in all knots.
    """

    def __init__(
        self, numbers: list[int], all_layers: list[Layer], all_lines: list[Polyline], begin: int
    ) -> None:
        layers, lines = [all_layers[i] for i in numbers], [all_lines[i] for i in numbers]
        clip = lines[0].clip
        self.numbers, self.id, self._turns, self._begin = numbers, clip.id, clip.finest_motion.turns, begin
        self.fed: Float | None = None
        self._clocks = LayerClocks.from_layers(layers, [clip] * len(layers))
        self._bones = np.concatenate([line.bones for line in lines])
        self._first = np.cumsum([0, *(len(line.bones) for line in lines)]).astype(np.int32)
        self._bases = np.array([line.base for line in lines], np.int32)
        self._weights = np.array([layer.weight for layer in layers])
        self._turned = np.array([layer.basis for layer in layers])
        self._mirrored = np.array([layer.mirrored for layer in layers])

    def sample(self, times: Float, out: Float) -> None:
        """Writes the rotations at the knots of these layers into ``out`` (T, K, 4), which contains all
        layers.
        """
        if self.fed is not None:
            still = np.zeros((len(times), len(self._bases)))
            self._write_knot_turns(self.fed, still, still + self._weights, out)
            return
        frames, weights = self._clocks.frames_at(times), self._weights * self._clocks.weight_curves(times)
        self._write_knot_turns(self._turns, frames.frame, weights, out)
        if not frames.is_plain:
            others = np.empty_like(out)
            self._write_knot_turns(self._turns, frames.other, weights, others)
            blend_knots(others, frames.share, frames.weight, self._first, self._begin, out)

    def weights(self, times: Float) -> Float:
        """Returns the fade weights (T, L) of these layers."""
        if self.fed is not None:
            return np.ones((len(times), len(self._bases)))
        return self._clocks.frames_at(times).weight * self._clocks.weight_curves(times)

    def _write_knot_turns(self, turns: Float, at: Float, weights: Float, out: Float) -> None:
        parameters = (weights, self._turned, self._mirrored, self._begin, out)
        knot_turns(turns, self._bones, self._first, self._bases, at, *parameters)


def active_layers(shape: RiggedCharacter) -> list[Layer]:
    """Returns the layers that rotate bones of the shape, without duplicates, muted layers and layers of
    weight 0.
    """
    layers = {layer.id: layer for layer in shape.layers if not layer.muted and layer.weight > 0.0}
    referenced = dict.fromkeys(ref.layer for spans in shape.spans for span in spans for ref in span.refs)
    return [layers[key] for key in referenced if key in layers]


def _sampling_group(layer: Layer) -> tuple[str, float]:
    """Returns the grouping key of layers that are sampled together: the take, and its smoothing."""
    return layer.take, layer.smooth
