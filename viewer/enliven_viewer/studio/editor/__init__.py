"""The editor without a window: the project with its past, time, camera and selection."""
