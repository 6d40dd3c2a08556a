"""Simulated dances: a model of skill, recordings of learners, and converters of recorded motion to dance sets."""
