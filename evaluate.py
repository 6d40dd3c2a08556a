"""Evaluates estimators and dance scores: `python evaluate.py --help`, kpopnet/programs/evaluate.py."""

from kpopnet.cli import run

if __name__ == "__main__":
    run("evaluate")
