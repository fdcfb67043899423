"""Attaches a body to the nodes of a mesh within its reach. If no node is within reach, an error explains the
reason.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from enliven.arrays import Float
from enliven.deformation.graph.graph import DeformationGraph
from enliven.errors import InputError
from enliven.person import Body, parse_parts
from enliven.possession.actor_settings import ActorSettings
from enliven.possession.attachment import ReachGrowth, attach
from enliven.possession.performer_attachment import TransformedAttachment
from enliven.possession.rest_transform import RestTransform

_MIN_ATTACHED_FRACTION = 0.9
"""Minimum fraction of the bones that must attach if the joints are already inside the mesh."""


def attach_within_reach(
    graph: DeformationGraph,
    settings: ActorSettings,
    body: Body,
    parts: str,
    rest_transform: RestTransform,
    deformed: tuple[Float, Float] | None,
) -> TransformedAttachment:
    """Attaches a body, transformed by ``rest_transform``, to a graph.

    Lengths in the settings are measured in the performer's metres.

    Args:
        rest_transform: transform from the world into the rest space.
        deformed: current (N, 3, 3) linear parts and (N, 3) positions of the nodes. None if the mesh is at
            rest.
    """
    attachment_settings, metre = settings.attachment, 1.0 / rest_transform.scale
    scaled_settings = replace(
        attachment_settings,
        radius=metre * attachment_settings.radius,
        reach=metre * attachment_settings.reach,
    )
    grow = ReachGrowth(
        _MIN_ATTACHED_FRACTION if rest_transform.fits else settings.enough, metre * settings.farthest_reach
    )
    joints, start_turns = rest_transform(body.joints), rest_transform.turns
    if rest_transform.at_rest is not None:
        joints, deformed, start_turns = rest_transform.at_rest, None, None
    attachment = attach(graph, joints, body.confidence, parts, scaled_settings, deformed, grow)
    return TransformedAttachment(attachment, rest_transform, parts, start_turns)


def make_out_of_reach_error(
    character: str,
    settings: ActorSettings,
    body: Body,
    grip: TransformedAttachment,
    nodes: Float,
    *,
    comes: bool = False,
) -> InputError:
    """Returns the error that explains why a body could not attach, and suggests a remedy.

    Args:
        grip: the attachment, which is empty.
        nodes: (N, 3) metres, current positions of the nodes in the rest space.
        comes: True if the mesh moves to the body. Then it does not help if the performer steps nearer.
    """
    joints = grip.rest_transform(body.joints)[sorted(parse_parts(grip.parts))]
    distances = np.linalg.norm(joints[:, None] - nodes, axis=2)
    metres = float(np.nanmin(distances, initial=np.inf)) * grip.rest_transform.scale
    distance_text = f"; the nearest is {metres:.1f} m away" if np.isfinite(metres) else "; no joint is seen"
    advice = "Step into the mesh, or set place = 'meet', or how = 'beside'."
    if comes:
        advice = "Hold it with the whole body, or with other parts of it."
    return InputError(
        f"no part of the mesh is within {settings.farthest_reach} m of the body{distance_text}",
        where=f"possessing {character!r} with {grip.parts}",
        remedy=advice,
    )
