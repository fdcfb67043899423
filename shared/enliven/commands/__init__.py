"""Commands of the shared library: run both programs, and report what this machine lacks."""
