"""The teacher as an estimator sees them, for the programs that score: what it is off of all who dance the same is no fault."""

import numpy as np
from tqdm import tqdm

from kpopnet.dance.noise.table import SEEN, SEEN_BY
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator
from kpopnet.skeleton import JOINT_NAMES
from kpopnet.teacher.library import TeacherBody
from kpopnet.teacher.posing import at_rate, posed


def seen_teacher(teacher: Performance, name: str, estimator: Estimator | None = None) -> Performance:
    """The teacher's dance as the estimator of a name of SEEN_BY sees it, the package's unless one is given.

    It takes a core eight tenths of the dance's length; a bar shows how far it is. Raises InputError where no such estimator is
    known, a joint is missing throughout, or the dance is too long.
    """
    from kpopnet.pose.person import PersonEstimator
    from synth.body.teacher import teacher_arrays
    from synth.dances.seen import FPS, PEOPLE, seen_joints_m

    if name not in SEEN_BY:
        raise InputError(f"the teacher as {name} sees them: known of {', '.join(SEEN_BY)}")
    if missing := [JOINT_NAMES[joint] for joint in teacher.unseen_joints]:
        raise InputError(f"the teacher as {name} sees them: {', '.join(missing)} missing in every frame; all joints are needed")
    estimator = estimator or _build(name)
    if isinstance(estimator, PersonEstimator):
        estimator.fps = FPS
    joints_m = at_rate(teacher, FPS).astype(np.float64)
    movement = posed(joints_m, TeacherBody(**teacher_arrays()))
    with tqdm(total=PEOPLE, desc=f"the teacher as {name} sees them", unit="person", leave=False, disable=None) as bar:
        seen_m = seen_joints_m(joints_m, *movement, estimator, bar.update)
    return Performance(seen_m, teacher.times_s[0] + np.arange(len(seen_m)) / FPS, estimator=f"{name}{SEEN}")


def _build(name: str) -> Estimator:
    from kpopnet.evaluation.registry import ESTIMATORS

    kind, builder = ESTIMATORS[name]
    return builder(kind())
