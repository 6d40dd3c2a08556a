"""What estimators are judged on: one reader a data set, the metrics, the run and its report.

reader (synthetic, eval, smmc10, itop, utd_mhad) -> Sequence -> estimator -> metrics -> report
"""
