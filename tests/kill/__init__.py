"""Kills of programs and failures of power: `make kill`, or `python -m tests.kill --help`."""
