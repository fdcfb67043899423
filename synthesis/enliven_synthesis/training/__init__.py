"""The training of the pose estimator: data set, network, losses, quantisation."""
