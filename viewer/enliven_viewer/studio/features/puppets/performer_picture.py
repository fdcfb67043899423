"""The performer as a mannequin of capsules on the stage's floor.

Paired joints have the colours of their control points.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from enliven.arrays import Float32
from enliven_viewer.render.materials.paint import linear_from_srgb
from enliven_viewer.render.overlay.tubes import Tubes, make_tube_rows
from enliven_viewer.render.renderer import Renderer
from enliven_viewer.render.scene import PLAIN, Scene
from enliven_viewer.studio.features.puppets.performer_view import PerformerFigure
from enliven_viewer.studio.viewport.picking import Lens
from enliven_viewer.theme import HOVERED_JOINT, UNSELECTED_BONE, get_point_colour

_LIMB_RADIUS = 0.026
"""Radius of a limb as a fraction of the performer's height."""
_JOINT_RADIUS = 0.020
"""Radius of a joint as a fraction of the performer's height. It is smaller than a limb's, so that the limb
hides it.
"""
_PAIRED_JOINT_RADIUS = 0.033
"""Radius of a paired joint as a fraction of the performer's height. It is larger than a limb's, so that the
joint is visible.
"""
_DEPTH_BIAS_M = 0.3
"""Depth bias in metres. Tubes up to this depth below other surfaces stay visible. It is more than a limb's
thickness.
"""


class PerformerPicture:
    """A render pass that draws figures into the image of a renderer.

    Args:
        renderer: draws the figures. Other passes may use it in between.
    """

    def __init__(self, renderer: Renderer) -> None:
        self.renderer = renderer
        self._tubes = Tubes(renderer.ctx)

    def draw(
        self, figure: PerformerFigure, lens: Lens, paired: Mapping[int, int], highlighted_joint: int | None
    ) -> None:
        """Draws and resolves one image.

        ``paired`` maps joints to numbers of control points; ``highlighted_joint`` may be None.
        """
        low, high = figure.joints.min(0), figure.joints.max(0)
        self.renderer.draw(Scene((), (), PLAIN, extent=(low, high)), lens.view)
        self._tubes.draw(
            self.renderer.picture, make_figure_rows(figure, paired, highlighted_joint), _DEPTH_BIAS_M
        )


def make_figure_rows(
    figure: PerformerFigure, paired: Mapping[int, int], highlighted_joint: int | None
) -> Float32:
    """Returns (N, 12) rows of :class:`~enliven_viewer.render.overlay.tubes.Tubes`: limbs, then joints."""
    parents, height = figure.skeleton.parents, figure.height
    starts, ends = figure.joints[parents[1:]], figure.joints[1:]
    radii = np.full(len(starts), _LIMB_RADIUS * height)
    bones = make_tube_rows(
        starts, ends, radii, linear_from_srgb(np.tile(np.array(UNSELECTED_BONE, float), (len(starts), 1)))
    )
    bones[:, 7] *= 0.72
    sizes = np.full(len(figure.joints), _JOINT_RADIUS * height)
    tints = np.tile(np.array(UNSELECTED_BONE, float), (len(figure.joints), 1))
    for joint, point in paired.items():
        sizes[joint], tints[joint] = _PAIRED_JOINT_RADIUS * height, get_point_colour(point)
    if highlighted_joint is not None:
        sizes[highlighted_joint], tints[highlighted_joint] = (
            max(sizes[highlighted_joint], 0.9 * _PAIRED_JOINT_RADIUS * height),
            HOVERED_JOINT,
        )
    return np.concatenate(
        [bones, make_tube_rows(figure.joints, figure.joints, sizes, linear_from_srgb(tints))]
    )
