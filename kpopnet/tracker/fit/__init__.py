"""The body model fitted to the depth: cost, solver, limbs laid anew, thickness of the parts, confidence."""
