"""The errors of estimators of joints, in the score."""
