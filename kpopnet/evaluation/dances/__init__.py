"""Evaluation of dance scores against the order that experts gave (section 4.3)."""
