"""The fit of the body model to a depth image: damped Gauss-Newton with data, prior and landmark terms."""
