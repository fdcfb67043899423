"""The commands of the shared library, such as ``enliven run`` and ``enliven doctor``."""
