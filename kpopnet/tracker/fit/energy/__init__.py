"""The energy that a pose has given a depth image: a file a term, each with its cost and its linearisation.

The cost compares whole poses (`kpopnet.tracker.fit.objective`); the linearisation moves a pose (`kpopnet.tracker.fit.solver`).
`points` and `free_space` tie the body to the depth, `lengths`, `penetration` and `joint_priors` hold it together. Lengths have
no cost: all poses that are compared come from the solver, or have the body's lengths by construction. The solver has one term
more, the distance to its start. Points and joints are in the camera frame in metres throughout.
"""
