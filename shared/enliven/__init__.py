"""enliven: everything that is mathematics, a format or a message.

No camera, no window, no thread and no global state lives here, so that the edge, the viewer and
user scripts can share it. Units are metres, seconds and radians; the world is right-handed with
+Y up and the floor at y = 0; quaternions are (w, x, y, z).
"""

__version__ = "0.1.0"
