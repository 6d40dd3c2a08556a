"""Trains a network or the random tree walk: `python train.py --help`, kpopnet/programs/train.py."""

from kpopnet.cli import run

if __name__ == "__main__":
    run("train")
