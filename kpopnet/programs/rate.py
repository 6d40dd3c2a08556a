"""Collects people's judgements of learners in a set of dances, and says how far these people agree.

    kpopnet rate FOLDER                   opens a page: two learners beside their teacher, which one dances better?
    kpopnet rate FOLDER --report          agreement of the raters, their consistency, scorers beside them
    kpopnet rate FOLDER --write-labels    turns ratings that agree into labels.csv, in dances that have none

FOLDER is in the K-Pop format (docs/kpop_format.md); labels.csv may be missing. Raters see skeletons: no names, no ranks, no
scores. Their answers are kept one by one in FOLDER/ratings/RATER.json, so a rater may stop and go on at any time. Learners
without true joints are shown with joints by mode best of the package, which are estimated once before the page opens.

Without recordings, try it on simulated dances (which no person danced):

    python -m synth benchmark=kpop_sim benchmark.dances=6 out=data/rate_me
    kpopnet rate data/rate_me
"""

import argparse
from functools import cache, partial
from pathlib import Path

from tqdm import tqdm

from kpopnet.dance.performance import Performance
from kpopnet.datasets.dances.dance_set import LABELS, Dance, KpopSet, Learner
from kpopnet.datasets.dances.ratings import RATINGS, read_all_ratings
from kpopnet.datasets.dances.writer import write_labels
from kpopnet.errors import InputError, check_seed
from kpopnet.evaluation.dances.raters import agreed_order, votes_of
from kpopnet.programs.arguments import add_address, check_server, program_parser
from kpopnet.runtime.atomic_write import write_json
from kpopnet.runtime.cpu import available_cores
from kpopnet.runtime.endings import user_errors
from kpopnet.runtime.folder_lock import locked

PORT = 8472


@cache
def estimated(folder: Path):
    """The joints of a set's learners by mode best of the package, a `PoseCache`."""
    from kpopnet.evaluation.dances.pose_cache import PoseCache
    from kpopnet.evaluation.registry import BestConfig

    return PoseCache(folder / "poses", "best", BestConfig())


def shown_joints(dance: Dance, learner: Learner) -> Performance:
    """The joints of a learner that raters see: the true ones, or those by mode best."""
    truth = learner.joints()
    return estimated(dance.folder.parent).poses(dance, learner)[0] if truth is None else truth


def serve(given: argparse.Namespace, dances: KpopSet) -> None:
    """Serves the page until the program is interrupted; a damaged recording is reported before that."""
    check_server("kpopnet rate", given.port)
    from kpopnet.teacher.hosting import host
    from kpopnet.teacher.rating import Rating, figure, make_rating_app

    rating = Rating(dances, given.seed, shown_joints)
    for name in tqdm(dances.names, "reading dances", unit="dance", disable=None):
        dance = dances.dance(name)
        try:
            for performance in (dance.teacher(), *(rating.joints(dance, learner) for learner in dance.learners)):
                figure(performance)
        except InputError as error:
            raise InputError(f"{dance.folder}: {error}") from error
    with locked(dances.folder / RATINGS):
        host(partial(make_rating_app, rating), given, "rate at")


def report(given: argparse.Namespace, dances: KpopSet, learners: dict[str, list[str]]) -> None:
    """Prints the report and writes ratings.html and ratings.json."""
    from kpopnet.evaluation.dances.rating_report import rating_report
    from kpopnet.evaluation.report import as_html, as_text, write_text

    ratings = read_all_ratings(dances.folder, learners)
    with locked(given.out):  # from the beginning: the estimation of joints may take minutes
        blocks, figures = rating_report(dances, ratings, given.seed, available_cores())
        write_text(given.out / "ratings.html", as_html(blocks))
        write_json(given.out / "ratings.json", figures, allow_nan=False)
    print(as_text([*blocks, f"look at {given.out / 'ratings.html'}"]))


def label(dances: KpopSet, learners: dict[str, list[str]]) -> None:
    """Writes labels.csv of the dances on which the raters agree and which have none."""
    votes = votes_of(learners, read_all_ratings(dances.folder, learners))
    for name in dances.names:
        order, reason = agreed_order(votes[name]) if name in votes else ([], "no rater has answered all of its pairs")
        if (dances.folder / name / LABELS).exists():
            reason = f"has {LABELS} already, which stays"
        if not reason:
            write_labels(dances.folder / name, order)
        print(f"{name}: {reason or 'labelled: ' + ', '.join(order)}")


@user_errors
def main() -> None:
    parser = program_parser("kpopnet rate", __doc__)
    parser.add_argument("folder", type=Path, help="a set of dances in the K-Pop format")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--report", action="store_true", help="print the agreement; write it as a page and JSON")
    what.add_argument("--write-labels", action="store_true", help="write the ranks on which two or more raters agree")
    parser.add_argument("--seed", type=int, default=0, help="of the raters' orders, and of resampling: %(default)s")
    parser.add_argument("--out", type=Path, default=Path("outputs/rate"), help="folder of the report: %(default)s")
    add_address(parser, PORT)
    given = parser.parse_args()
    check_seed("--seed", given.seed)
    dances = KpopSet(given.folder, ranked=False)
    learners = {name: [one.name for one in dances.dance(name).learners] for name in dances.names}
    if given.report:
        report(given, dances, learners)
    elif given.write_labels:
        label(dances, learners)
    else:
        serve(given, dances)
