"""The body model fitted to the depth: cost, solver, pose hypotheses, thickness of the parts."""
