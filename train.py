"""Trains a network or the random tree walk: `python train.py --help`, kpopnet/programs/train.py."""

from kpopnet.runtime.endings import begin_imports, end_imports

if __name__ == "__main__":
    begin_imports()
    from kpopnet.programs.train import main

    end_imports()
    main()
