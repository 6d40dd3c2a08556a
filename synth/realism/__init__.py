"""Realism as numbers: statistics of generated depth beside the same statistics of real depth."""
