"""The Y pose (section 2.3): the first joints and all lengths of a person, from which both trackers may start."""
