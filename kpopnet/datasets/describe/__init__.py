"""Descriptions of downloaded data sets: their contents, and what an evaluation still needs."""
