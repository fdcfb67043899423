"""The fit of the body model to a depth image: damped Gauss-Newton over data, prior and landmark terms."""
