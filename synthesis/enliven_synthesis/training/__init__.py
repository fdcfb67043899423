"""The training of the pose estimator: the data set of rendered people, and the network that learns it."""

from enliven_synthesis.training.dataset import Album, render_album

__all__ = ["Album", "render_album"]
