"""The health of sensor and performance as the user reads it: states, remedies, and when to report them."""
