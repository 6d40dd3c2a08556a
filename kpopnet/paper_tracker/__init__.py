"""The paper's tracker: the initial model from the Y pose (section 2.3) and Algorithm 2 (section 2.4)."""
