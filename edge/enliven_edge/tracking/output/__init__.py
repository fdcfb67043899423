"""What leaves the tracker: joints smoothed, limited in speed, kept on the floor and predicted by the delay."""
