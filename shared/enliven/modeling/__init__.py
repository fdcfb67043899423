"""Modeling: cutting and merging shapes without losing their motion, and making them from strokes."""
