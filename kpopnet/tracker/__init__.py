"""The paper's tracker: no learning, only ridge data and the lengths of the one person who is followed.

depth of the person -> ridge data -> initial model (once) -> Algorithm 2, frame after frame -> joints
"""
