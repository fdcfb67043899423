"""Post-processing of fitted bodies: smooths joints, limits speeds, detects foot contacts, predicts, mirrors.

The prediction compensates the delay between the sensor and the display.
"""
