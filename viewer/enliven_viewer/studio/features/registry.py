"""Registers the features of the studio: those of this package, and those that other packages add by entry
points.

A new feature needs a package with a ``register`` function, and one line in this module. A feature of another
package needs an entry point of the group ``enliven.studio_features`` that refers to its ``register``
function.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points

from enliven.errors import EnlivenError, ResourceError
from enliven_viewer.language import tr
from enliven_viewer.studio.app.app import App
from enliven_viewer.studio.features.animation import feature as animation
from enliven_viewer.studio.features.mapping import feature as mapping
from enliven_viewer.studio.features.outliner import feature as outliner
from enliven_viewer.studio.features.paint import feature as paint
from enliven_viewer.studio.features.perform import feature as perform
from enliven_viewer.studio.features.puppets import feature as puppets
from enliven_viewer.studio.features.scan import feature as scan
from enliven_viewer.studio.features.sound import feature as sound
from enliven_viewer.studio.features.timeline import feature as timeline
from enliven_viewer.studio.features.tour import feature as tour

Register = Callable[[App], object]
ENTRY_POINTS = "enliven.studio_features"
"""Entry-point group through which other packages add features. An entry point refers to a function that
takes the :class:`App`.
"""
FEATURES: tuple[Register, ...] = (
    perform.register,
    outliner.register,
    mapping.register,
    paint.register,
    sound.register,
    animation.register,
    scan.register,
    puppets.register,
    timeline.register,
    tour.register,
)
"""The register function of each feature of this package. Their order is the order of their
actions in menus.
"""


def register_features(app: App) -> None:
    """Registers all features.

    If a feature of another package raises an error, the studio shows the error and starts anyway.
    Contributions that the feature made before the error stay.
    """
    for register in FEATURES:
        register(app)
    for entry in entry_points(group=ENTRY_POINTS):
        try:
            entry.load()(app)
        except Exception as error:  # No error of another package may prevent the studio from starting.
            reason = f"{error.where}: {error.what}" if isinstance(error, EnlivenError) else str(error)
            problem = tr("the feature {0} cannot be loaded: {1}", entry.name, reason)
            remedy = tr("Update or remove the package {0}.", entry.dist.name if entry.dist else entry.value)
            app.editor.toasts.show_error(ResourceError(problem, where=entry.value, remedy=remedy))
