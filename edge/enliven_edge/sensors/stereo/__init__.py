"""Two cameras as a depth sensor: calibration from a printed board, and depth by stereo matching."""
