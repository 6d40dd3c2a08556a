"""Finds everybody in one depth image, learnt from simulated scenes."""
