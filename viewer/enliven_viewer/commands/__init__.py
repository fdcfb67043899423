"""The commands ``enliven view``, ``enliven studio`` and ``enliven graph``."""
