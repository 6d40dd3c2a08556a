"""Simulated EVAL and SMMC-10 (`eval_sim`, `smmc10_sim`), written in the file formats of the real sets."""
