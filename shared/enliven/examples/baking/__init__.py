"""Baking: a surface that control points move becomes bones and morph targets that other programs play."""
