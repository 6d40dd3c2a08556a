"""Long runs of the online path: `python -m tests.soak --help`."""
