"""The commands of the viewer: ``enliven view``, ``studio``, ``stage``, ``graph`` and ``kiosk-window``."""
