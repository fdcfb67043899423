"""Drivers of depth cameras. Each opens, reads and closes a camera, or rehearses with the images of a
recording.

Common tasks are in other modules: :mod:`enliven_edge.sensors.reopening` opens cameras again, and
:mod:`enliven_edge.sensors.isolation` keeps crashes out of the edge. The common arguments of the drivers are:

    width, height: pixels of the depth image. fps: images per second. rehearse: a recording that is played
    through the camera's library instead of a camera. before: the identity of the camera that was open last.
    It is preferred if there are several.

Every driver raises InputError for a mode, preset or recording that cannot be used. It raises ResourceError if
its library or the camera is missing, or the camera is in use.
"""
