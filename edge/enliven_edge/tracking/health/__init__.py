"""The health of sensor and performance as the user reads it: states, what to do, and when to say so."""
