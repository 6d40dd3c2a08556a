"""Imported before any test module, and so before torch: kpopnet sets how OpenMP's threads wait.

Hypothesis tries the same examples in every run, so that a change is judged by what it changed;
`pytest --hypothesis-profile=default` looks for new ones.
"""

from hypothesis import settings

import kpopnet  # noqa: F401

settings.register_profile("repeatable", derandomize=True)
settings.load_profile("repeatable")
