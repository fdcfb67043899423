"""The stage: the characters that performers possess, drive and release, frame by frame.

:class:`Stage` has one actor for each character. This package has the actor of a possessed mesh. The package
``rig`` has the actor of a rigged model, and ``puppet`` has the actor of a mesh that is animated by key poses.
"""
