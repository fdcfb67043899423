"""Edits of single layers, for tests; programs change layers of all rigs by ``change_layers``."""

from dataclasses import replace


def set_layer(project, shape_id, layer_id, **changes):
    """A project with a layer of a shape changed: muted, weight, offset, speed, loop, basis, mirrored.

    Raises:
        InputError: where there is no such layer, or it cannot be played like that.
    """
    shape = project.shape(shape_id)
    wanted = shape.layer(layer_id)
    layers = tuple(replace(one, **changes) if one is wanted else one for one in shape.layers)
    return project.with_characters(shape.with_changes(layers=layers))
