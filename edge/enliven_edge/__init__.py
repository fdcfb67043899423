"""The edge: the program on the computer with the depth camera.

It tracks people, animates characters and publishes both.

:mod:`enliven_edge.service` has the main loop. Each stage of a frame is a separate package;
``docs/architecture.md`` has the overview.
"""

from enliven_edge.onnx_runtime import disable_telemetry

# Disable telemetry before a sensor or reader of another package can load the library.
disable_telemetry()
