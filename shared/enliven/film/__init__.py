"""Films: writes images and sound to an MP4 file, with the encoders that are available on this machine."""
