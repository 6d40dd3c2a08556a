"""Simulated benchmarks of films: `eval_sim`, `smmc10_sim`, `two_people`, `rooms`, `check_sim`."""
