"""Fuzzing of every file format that is read: `make fuzz`, or `python -m tests.fuzz --help`."""
