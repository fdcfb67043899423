"""Computes bone lengths and stretches from the layers of a shape, in addition to the rotations.

    stretching = StretchLayers.of(sampler, shape)           # None if no layer's take stretches anything
    offsets, strains = stretching.evaluate(times)           # (T, N, 3) metres, (T, N, 6)

A bone of the take corresponds to an interval of arc length. Its strain applies to all bones of the shape on
this interval. Its offset is scaled to the shape, and distributed to these bones in proportion to their arc
length. So if a node divides a bone, both halves keep its stretch, and their offsets sum to the offset of the
whole bone. The strains of several layers on a bone are summed, because strains are logarithms.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from enliven.arrays import Float
from enliven.document import Clip, Layer, Ref, RiggedCharacter, Span
from enliven.motion.layers.polyline import Polyline, locate_on_knots
from enliven.motion.layers.sampling import Sampler
from enliven.motion.layers.timing import LayerClocks
from enliven.rotation import rotate, rotate_strain, stretch_from_strain

_MIN_BONE_FRACTION = 1e-9
"""Minimum usable length of a bone, as a fraction of the shape's longest bone."""
_FRAME_ROUNDING = 1e-6
"""Maximum distance of a time from a frame that counts as exactly at the frame, as a fraction of a frame."""
_STRAIN_REFLECTION_SIGNS = np.array([1.0, 1.0, 1.0, -1.0, -1.0, 1.0])
"""(6,) factors of 1 or -1 that reflect the components of a strain in the plane x = 0."""


@dataclass(frozen=True, eq=False)
class _StretchLayer:
    """One layer that stretches bones.

    Attributes:
        bones: (B,) bones of the take along the layer's chain.
        signs: (B,) 1, or -1 for a bone that the chain traverses upwards.
        offsets: (N, B) for each bone of the shape, the factor on each take bone's offset.
        strains: (N, B) for each bone of the shape, the factor on each take bone's strain.
    """

    layer: Layer
    clip: Clip
    clock: LayerClocks
    bones: list[int]
    signs: Float
    offsets: Float
    strains: Float

    def evaluate(self, times: Float) -> tuple[Float, Float]:
        """Returns (T, N, 3) offsets and (T, N, 6) strains at times (T,)."""
        clip_frames = self.clock.frames_at(times)
        weight = clip_frames.weight[:, 0] * self.layer.weight
        finest = self.clip.finest_motion
        totals = [np.zeros((len(times), len(self.bones), 3)), np.zeros((len(times), len(self.bones), 6))]
        for out, track in zip(totals, (finest.offsets, finest.strains), strict=True):
            if track is not None:
                current, other = (
                    _interpolate_track(track[:, self.bones], frames[:, 0])
                    for frames in (clip_frames.frame, clip_frames.other)
                )
                out += weight[:, None, None] * (current + clip_frames.share[:, :1, None] * (other - current))
        offsets, strains = totals[0] * self.signs[:, None], totals[1]
        if self.layer.mirrored:
            offsets, strains = offsets * [-1.0, 1.0, 1.0], strains * _STRAIN_REFLECTION_SIGNS
        offsets, strains = rotate(self.layer.basis, offsets), rotate_strain(self.layer.basis, strains)
        return np.einsum("nb,tbc->tnc", self.offsets, offsets), np.einsum(
            "nb,tbc->tnc", self.strains, strains
        )

    def mirrors(self, times: Float) -> Float | None:
        """Returns an array (T, N) that is -1 for bones that are mirrored at a time, and otherwise 1. Returns
        None if no bone is ever mirrored.
        """
        track = self.clip.finest_motion.mirrors
        if track is None:
            return None
        clip_frames, main_bone = self.clock.frames_at(times), self.strains.argmax(1)
        frames = np.where(clip_frames.share[:, 0] > 0.5, clip_frames.other[:, 0], clip_frames.frame[:, 0])
        # Between two frames, use the first frame, because mirroring cannot be interpolated.
        rows = track[np.floor(frames + _FRAME_ROUNDING).astype(int)][:, self.bones]
        is_active = (clip_frames.weight[:, 0] * self.layer.weight > 0.5)[:, None] & (
            self.strains.max(1) > 0.5
        )
        return np.where(is_active, rows[:, main_bone], 1.0)


class StretchLayers:
    """All the layers of a shape that stretch bones."""

    def __init__(self, layers: list[_StretchLayer]) -> None:
        self._layers = layers

    @staticmethod
    def from_sampler(sampler: Sampler, shape: RiggedCharacter) -> StretchLayers | None:
        """Collects the layers of a shape that use the lengths and stretches of their takes. Returns None if
        there are none.
        """
        layers_and_lines = zip(sampler.layers, sampler.lines, strict=True)
        stretching_layers = [
            (layer, line) for layer, line in layers_and_lines if layer.stretch and line.clip.has_deformation
        ]
        ratios = [_length_ratios(layer, line, shape) for layer, line in stretching_layers]
        finite_ratios = [ratio[np.isfinite(ratio)] for ratio in ratios]
        usual = (
            float(np.median(np.concatenate(finite_ratios)))
            if any(len(layer_ratios) for layer_ratios in finite_ratios)
            else 1.0
        )
        stretched = [
            _prepare_layer(layer, line, shape, np.where(np.isfinite(ratio), ratio, usual))
            for (layer, line), ratio in zip(stretching_layers, ratios, strict=True)
        ]
        return StretchLayers(stretched) if stretched else None

    def evaluate(self, times: Float) -> tuple[Float, Float]:
        """Returns offsets (T, N, 3), metres, and strains (T, N, 6) at times (T,), in the same format as a
        clip.
        """
        sampled = [layer.evaluate(times) for layer in self._layers]
        return sum(offsets for offsets, _ in sampled), sum(strains for _, strains in sampled)  # type: ignore[return-value]

    def stretch(self, times: Float, strains: Float) -> Float | None:
        """Converts strains (T, N, 6) at times (T,) to stretches (T, N, 3, 3), including reflections. Returns
        None if all are the identity.
        """
        matrices = stretch_from_strain(strains) if strains.any() else None
        for layer in self._layers:
            mirrors = layer.mirrors(times)
            if mirrors is not None and (mirrors < 0.0).any():
                matrices = (np.eye(3) if matrices is None else matrices) * mirrors[..., None, None]
        return matrices


def _prepare_layer(layer: Layer, line: Polyline, shape: RiggedCharacter, ratios: Float) -> _StretchLayer:
    """Prepares one layer. ``ratios`` (N,) are metres of each bone of the shape per metre of the take."""
    skeleton, count = line.clip.skeleton, len(line.bones)
    upward = [int(skeleton.parents[a]) == b for a, b in pairwise(line.chain)] or [False]
    factors = np.zeros((2, len(shape.skeleton), count))
    widths = np.diff(line.knots)
    for j, spans in enumerate(shape.spans):
        for fraction, ref in _layer_parts(spans, layer):
            low, high = min(ref.start, ref.end), max(ref.start, ref.end)
            if low == high:
                # If a reference has zero length, the bone continues the bone before it, and gets its offset
                # in proportion to the lengths of both bones.
                knot = int(locate_on_knots(line.knots, np.array([low]))[0][0])
                take_length = float(skeleton.lengths[line.bones[knot]])
                factors[0, j, knot] += (
                    fraction * shape.skeleton.lengths[j] / take_length if take_length > 0.0 else 0.0
                )
                factors[1, j, knot] += fraction
                continue
            common = np.minimum(high, line.knots[1:]) - np.maximum(low, line.knots[:-1])
            common = np.maximum(common, 0.0)
            factors[0, j] += ratios[j] * common / widths
            factors[1, j] += fraction * common / (high - low)
    signs = np.where(upward, -1.0, 1.0)
    bones = line.bones.tolist()
    return _StretchLayer(
        layer, line.clip, LayerClocks.from_layers([layer], [line.clip]), bones, signs, *factors
    )


def _length_ratios(layer: Layer, line: Polyline, shape: RiggedCharacter) -> Float:
    """Returns the scale (N,) of each bone of a shape relative to a layer's take.

    The scale is NaN for a bone of zero length, and for all bones if the chain has zero length.
    """
    lengths, ratios = shape.skeleton.lengths, np.full(len(shape.skeleton), np.nan)
    take_positions = line.clip.skeleton.positions[list(line.chain)]
    take_positions = float(np.linalg.norm(np.diff(take_positions, axis=0), axis=1).sum())
    for j, spans in enumerate(shape.spans):
        refs = _layer_parts(spans, layer)
        layer_length = sum(abs(ref.end - ref.start) for _, ref in refs)
        if refs and layer_length * take_positions > 0.0 and lengths[j] > _MIN_BONE_FRACTION * lengths.max():
            ratios[j] = lengths[j] * sum(fraction for fraction, _ in refs) / (layer_length * take_positions)
    return ratios


def _layer_parts(spans: tuple[Span, ...], layer: Layer) -> list[tuple[float, Ref]]:
    """Returns a bone's references to a layer. Each is paired with its span's fraction of the bone's
    length."""
    return [(span.share, ref) for span in spans for ref in span.refs if ref.layer == layer.id]


def _interpolate_track(track: Float, at: Float) -> Float:
    """Interpolates a track (F, ...) at frame numbers (T,). Returns (T, ...)."""
    frame = np.clip(at.astype(int), 0, max(len(track) - 2, 0))
    fraction = np.clip(at - frame, 0.0, 1.0).reshape(-1, *(1,) * (track.ndim - 1))
    return np.asarray(track[frame] + fraction * (track[np.minimum(frame + 1, len(track) - 1)] - track[frame]))
