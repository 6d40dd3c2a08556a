"""A small library: the teacher's body and two dances."""

from functools import partial

import pytest

from kpopnet.programs.teach import open_source
from kpopnet.teacher.adding import add_dance
from kpopnet.teacher.library import About, Library, TaughtDance, TeacherBody, difficulty
from synth.dances.taught import Teacher, teacher_arrays


@pytest.fixture(scope="session")
def library(tmp_path_factory):
    made, teacher = Library(tmp_path_factory.mktemp("teach")), Teacher()
    made.write_body(TeacherBody(**teacher_arrays()))
    for index in (1, 2):
        played = teacher.dance(index)
        about = About(played.name, len(played.quats) / played.fps, played.bpm, difficulty(played.joints_m, played.fps))
        made.write(f"dance_{index:03d}", TaughtDance(about, played.fps, played.joints_m, played.quats, played.hips_m))
    return made


@pytest.fixture
def teaching(library, tmp_path):
    pytest.importorskip("aiohttp", reason="the extra app is not installed")
    from kpopnet.teacher.live.stage import Settings
    from kpopnet.teacher.server import Offer, Teaching
    from kpopnet.teacher.sessions import Sessions
    from synth.dances.live import FAULTS, SKILLS

    settings = Settings(partial(open_source, None), "tracker")
    offer = Offer({"simulated": "a simulated learner"}, SKILLS, FAULTS)
    return Teaching(library, Sessions(tmp_path / "tries"), settings, offer, partial(add_dance, library))
