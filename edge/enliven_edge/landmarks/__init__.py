"""Landmarks from a colour image, lifted into bodies: an addition that depth alone never needs."""
