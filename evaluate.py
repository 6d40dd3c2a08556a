"""Evaluates estimators and dance scores: `python evaluate.py --help`, kpopnet/programs/evaluate.py."""

from kpopnet.runtime.endings import begin_imports, end_imports

if __name__ == "__main__":
    begin_imports()
    from kpopnet.programs.evaluate import main

    end_imports()
    main()
