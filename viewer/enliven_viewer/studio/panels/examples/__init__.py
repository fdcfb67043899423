"""The panels of example poses: control points, the strip of key poses, motion and settings."""
