"""Baselines for the networks and trackers: the mean pose and the random tree walk."""
