"""Imported before any test module, and so before torch: kpopnet sets how OpenMP's threads wait."""

import kpopnet  # noqa: F401
