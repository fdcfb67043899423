"""The commands that the library itself owns: run both programs, and say what a machine lacks."""
