"""The initial pose and human model (section 2.3)."""
