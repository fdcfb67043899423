"""Puppets in the studio: the tool that poses them, the view of their performer, key poses and settings."""
