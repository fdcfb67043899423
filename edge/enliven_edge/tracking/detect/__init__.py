"""Detection of a posture without the frame before: hypotheses from extremities and the network, judged by
fits.
"""
