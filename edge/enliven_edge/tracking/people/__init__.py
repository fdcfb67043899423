"""The people in view: found, followed, recognised after an absence, and never counted twice."""
