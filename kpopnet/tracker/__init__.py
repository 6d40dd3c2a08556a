"""The tracker: the paper's Algorithm 2 and, beyond the paper, a body that is fitted to the depth. It needs no learning.

depth of the person -> ridge data -> initial model (once); then frame after frame:
Algorithm 2 and other starting points -> a body fitted from each of them -> limbs laid anew, a search in doubt, where a
network may be asked -> joints

`TrackerConfig(body=False)` is Algorithm 2 alone (`tracking`). `fitted` fits the same body to the joints that a network finds
in single frames.
"""
