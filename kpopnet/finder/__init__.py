"""Finds all people in one depth image, learnt from simulated scenes."""
