"""Readers of data sets in their published formats, and of simulated sets in the same formats."""
