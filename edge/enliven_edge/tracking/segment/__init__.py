"""Segmentation: assigns pixels to people, and finds blobs of pixels that may be a new person."""
