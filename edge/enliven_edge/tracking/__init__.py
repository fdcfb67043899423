"""The tracker: takes depth frames and returns 20 joints for each person.

The packages follow the processing order. ``frame`` checks and reduces a frame. ``scene`` holds the background
model. ``segment`` separates people from the background. ``body_model``, ``fit`` and ``detect`` estimate each
posture. ``people`` manages the tracks and identities. ``output`` smooths the result. ``health`` reports
problems. No package imports a later one.
"""
