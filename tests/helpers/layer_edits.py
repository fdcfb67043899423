"""Edits single layers, for tests. Product code edits layers of all rigs with ``change_layers``."""

from dataclasses import replace


def set_layer(project, shape_id, layer_id, **changes):
    """Returns a project with changed attributes of a layer: muted, weight, offset, speed, loop, basis,
    mirrored.

    Raises:
        InputError: if the layer does not exist, or it cannot be played with these values.
    """
    shape = project.shape(shape_id)
    wanted = shape.layer(layer_id)
    layers = tuple(replace(layer, **changes) if layer is wanted else layer for layer in shape.layers)
    return project.with_characters(shape.with_changes(layers=layers))
