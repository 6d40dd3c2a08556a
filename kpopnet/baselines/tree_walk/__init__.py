"""Random tree walk: a baseline for the trackers and the networks."""
