"""A small library: the teacher's body and two dances."""

from dataclasses import replace
from functools import partial

import pytest

from kpopnet.dance.joint_files.mediapipe import WEBCAM
from kpopnet.programs.teach import open_source
from kpopnet.skeleton import Joint
from kpopnet.teacher.library import Library, TeacherBody, taught_dance
from kpopnet.teacher.live.webcam import DESCRIPTION
from synth.body.teacher import teacher_arrays
from synth.dances.taught import Teacher


@pytest.fixture(scope="session")
def library(tmp_path_factory):
    made, teacher = Library(tmp_path_factory.mktemp("teach"), TeacherBody(**teacher_arrays())), Teacher()
    for index in (1, 2):
        one = teacher.dance(index)
        made.write(f"dance_{index:03d}", taught_dance(one.name, one.fps, one.bpm, one.joints_m, one.quats, one.hips_m))
    return made


@pytest.fixture
def teaching(library, tmp_path):
    pytest.importorskip("aiohttp", reason="the extra app is not installed")
    from kpopnet.teacher.server import Teaching
    from kpopnet.teacher.tries import Tries
    from synth.dances.live import FAULTS, SKILLS

    sources = {"simulated": "a simulated learner", WEBCAM: DESCRIPTION}
    return Teaching(library, Tries(tmp_path / "tries"), partial(open_source, None), "tracker", sources, SKILLS, FAULTS)


@pytest.fixture
def own(teaching, tmp_path):
    """The same with a library of the user's own, which is empty."""
    return replace(teaching, library=Library(tmp_path / "mine", teaching.library.body))


@pytest.fixture
def tried(teaching):
    """Saves a try of the first two seconds of a dance that claims to last longer; its name."""

    def save(seconds: float, speed: float = 1.0, who: str = "", unseen: tuple[Joint, ...] = ()) -> str:
        performance = teaching.library.dance("dance_001").performance
        arrays = {name: getattr(performance, name)[:60].copy() for name in ("times_s", "joints_m", "confidence")}
        arrays["confidence"][:, list(unseen)] = 0.0
        course = {"time_s": [0.5, 1.5], "total": [90.0, None], "parts": {"left arm": [1.0, 2.0]}}
        result = {"dance": "dance_001", "total": 81.5, "speed": speed, "from_s": 0.0, "to_s": seconds, "course": course}
        return teaching.tries.save(result | {"who": who}, arrays)

    return save
