"""Section 3 of the paper: dance features, their matching in time, and the score of a learner against a teacher."""
