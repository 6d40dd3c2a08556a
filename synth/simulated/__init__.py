"""Simulated EVAL and SMMC-10 (`eval_sim`, `smmc10_sim`) in the file formats of the real sets, and films of two people."""
