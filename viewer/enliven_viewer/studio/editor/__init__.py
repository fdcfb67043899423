"""The editor without a window: the project with its history, time, camera and selection."""
