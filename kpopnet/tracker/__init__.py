"""The body tracker: a body fitted to the depth of one person, frame after frame, without a network.

Depth of the person -> start pose and lengths, once -> for each frame: expected pose, fit from the best candidate, limbs, final
fit -> joints (`tracker`). `refine` fits the same body to the joints that a network detects in single frames. docs/trackers.md
says what each stage is worth. The paper's own tracker is `kpopnet.paper_tracker`.
"""
