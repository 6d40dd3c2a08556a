"""The tracker: the paper's Algorithm 2 and, beyond the paper, a body model fitted to the depth. It needs no training.

Initialisation, once: depth of the person -> ridge data -> initial model. Then for each frame: proposals (Algorithm 2 and
others) -> body fitted from each proposal -> limbs refitted -> if the cost stays high, a detector and perturbed poses ->
joints.

`TrackerConfig(body=False)` is Algorithm 2 alone (`tracker`). `fit.refine` fits the same body to the joints that a network
detects in single frames.
"""
