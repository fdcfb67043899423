"""Training of the pose estimator: the data set of rendered people, and the network."""
