"""The forest in use: the probability of every part at any pixel of a person, and its file."""

from __future__ import annotations

import zipfile
import zlib
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path

import numpy as np

from enliven.arrays import AnyArray, Float, Float32, Int, Int32, UInt8, UInt16
from enliven.errors import InputError
from enliven_edge.parts.features import find_leaves, mean_shares, millimetres, packed_nodes
from enliven_edge.parts.labels import FACINGS, PARTS

FORMAT = 2
"""The version of the file, which an older program refuses."""
_DOUBT = 0.02
"""Added to shares before their logarithm: no single pixel decides."""


@dataclass(frozen=True)
class Trees:
    """All nodes of all trees.

    Attributes:
        roots: (T,) int32 the first node of every tree.
        feature: (n,) uint16 the feature that a node asks for.
        threshold: (n,) float32.
        child: (n,) int32 the node where the response is below the threshold, the next node is the other; or
            -1 - leaf.
        posterior: (leaves, 17) uint8 the shares of the parts, 255 the whole.
        facing: (leaves, 8) uint8 the shares of the ways that the person faces, see
            :func:`enliven_edge.parts.labels.facing_of`.
    """

    roots: AnyArray
    feature: UInt16
    threshold: Float32
    child: AnyArray
    posterior: UInt8
    facing: UInt8

    @classmethod
    def joined(cls, trees: list[Trees]) -> Trees:
        """The trees of several as one."""
        roots, child, nodes, leaves = [], [], 0, 0
        for tree in trees:
            roots.append(tree.roots + nodes)
            child.append(np.where(tree.child >= 0, tree.child + nodes, tree.child - leaves))
            nodes, leaves = nodes + len(tree.child), leaves + len(tree.posterior)
        return cls(
            np.concatenate(roots).astype(np.int32),
            np.concatenate([tree.feature for tree in trees]),
            np.concatenate([tree.threshold for tree in trees]),
            np.concatenate(child).astype(np.int32),
            np.concatenate([tree.posterior for tree in trees]),
            np.concatenate([tree.facing for tree in trees]),
        )


class PartForest:
    """Names the part of the body at a depth pixel.

    Args:
        features: (F, 4) float32 metres, the offsets that nodes ask with.
        trees: of which every leaf knows the shares of the parts.
    """

    def __init__(self, features: Float32, trees: Trees) -> None:
        self.features, self.trees = features, trees

    @cached_property
    def _nodes(self) -> Float32:
        """(n, 8) what a walk asks."""
        t = self.trees
        return packed_nodes(self.features, t.feature, t.threshold, t.child)

    def probabilities(
        self, z: Float, camera: Float, rows: Int, columns: Int, *, roll: float = 0.0
    ) -> Float32:
        """(M, 17) float32 the probability of every part at M pixels; all 0 where a pixel is off the person.

        The arguments are those of :meth:`leaves`.
        """
        return self.parts_of(self.leaves(z, camera, rows, columns, roll=roll))

    def parts_of(self, leaves: Int32) -> Float32:
        """(M, 17) the probability of every part at pixels that reached these (M, T) leaves."""
        out = np.empty((len(leaves), PARTS), np.float32)
        mean_shares(self.trees.posterior, leaves, out)
        return out

    def facing_of(self, leaves: Int32) -> Float:
        """(8,) the mean log likelihood, over pixels, of every way that the person may face."""
        out = np.empty((len(leaves), FACINGS), np.float32)
        mean_shares(self.trees.facing, leaves, out)
        return np.asarray(np.log(out[leaves[:, 0] >= 0] + _DOUBT).mean(0), np.float64)

    def leaves(self, z: Float, camera: Float, rows: Int, columns: Int, *, roll: float = 0.0) -> Int32:
        """(M, T) int32 the leaf that each of M pixels reaches in each tree; -1 where it is off the person.

        Args:
            z: (h, w) metres along the optical axis of the person's pixels, 0 elsewhere.
            camera: (4,) fx, fy, cx, cy in pixels of this image.
            rows, columns: (M,) the pixels.
            roll: radians that the person's upright is turned clockwise in the image: pi for a sensor that
                hangs upside down.
        """
        out = np.empty((len(rows), len(self.trees.roots)), np.int32)
        bordered = millimetres(z)
        turn = (np.float32(np.cos(roll)), np.float32(np.sin(roll)))
        find_leaves(
            bordered.ravel(), *bordered.shape, rows + 1, columns + 1, camera[0], camera[1], turn,
            self.trees.roots, self._nodes, out,
        )  # fmt: skip
        return out

    def save(self, path: Path) -> None:
        """Writes the forest; the file says of itself whether it is whole."""
        t = self.trees
        np.savez_compressed(
            path, format=np.array([FORMAT, PARTS]), features=self.features, roots=t.roots, feature=t.feature,
            threshold=t.threshold.astype(np.float32), child=t.child, posterior=t.posterior, facing=t.facing,
        )  # fmt: skip

    @classmethod
    def load(cls, path: Path) -> PartForest:
        """The forest of a file.

        Raises:
            InputError: where there is none, or it is damaged, or of another version.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                values = {name: file[name] for name in file.files}
            found = values["format"].tolist()
            if found != [FORMAT, PARTS]:
                raise _bad(path, f"it is of another version ({found}, not {[FORMAT, PARTS]})")
            trees = Trees(*(values[field.name] for field in fields(Trees)))
            forest = cls(values["features"], trees)
        except FileNotFoundError:
            raise InputError("there is no such file", where=str(path), mend=_MEND) from None
        except (*_DAMAGED, zipfile.BadZipFile, zlib.error) as error:
            raise _bad(path, f"it is damaged ({error})") from None
        problem = forest._problem()
        if problem:
            raise _bad(path, f"it is damaged ({problem})")
        return forest

    def _problem(self) -> str:
        """What would send a walk astray; empty where nothing would."""
        t = self.trees
        nodes = len(t.child)
        shapes = {len(t.feature), len(t.threshold), nodes}
        if len(shapes) > 1 or self.features.ndim != 2 or self.features.shape[1] != 4:
            return "its tables do not belong together"
        if t.posterior.ndim != 2 or t.posterior.shape[1] != PARTS or not np.isfinite(t.threshold).all():
            return "its posteriors are not of the parts"
        if (
            t.facing.shape != (len(t.posterior), FACINGS)
            or not t.posterior.any(1).all()
            or not t.facing.any(1).all()
        ):
            return "its leaves say nothing"
        inner = t.child >= 0
        if nodes == 0 or len(t.roots) == 0 or t.roots.min() < 0 or t.roots.max() >= nodes:
            return "it has no trees"
        if (t.child[inner] <= np.flatnonzero(inner)).any() or (t.child[inner] + 1 >= nodes).any():
            return "its nodes run in a circle"
        if (-1 - t.child[~inner]).max() >= len(t.posterior) or t.feature.max() >= len(self.features):
            return "its leaves are missing"
        return ""


_DAMAGED = (OSError, ValueError, KeyError, EOFError, RuntimeError)
"""What reading a damaged archive raises, besides its own errors."""
_MEND = "Make it again with: enliven train-parts -o FILE"


def _bad(path: Path, what: str) -> InputError:
    return InputError(f"this is no forest of body parts: {what}", where=str(path), mend=_MEND)
