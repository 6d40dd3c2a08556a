"""Evaluation of estimators and scorers on data sets, and its reports."""
