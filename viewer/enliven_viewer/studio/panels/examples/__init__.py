"""The panels of example-based puppets: control points, the strip of key poses, motion and settings."""
