"""How well the dance teacher keeps up with a camera, in real time: two cores, a simulated learner, the tracker."""

import asyncio
import tempfile
from functools import partial
from pathlib import Path

from kpopnet.programs.teach import open_source
from kpopnet.teacher.library import About, Library, TaughtDance, TeacherBody, difficulty
from kpopnet.teacher.live.crew import Crew
from kpopnet.teacher.live.lesson import Lesson
from kpopnet.teacher.live.stage import Settings
from synth.dances.taught import Teacher, teacher_arrays

SECONDS = 20.0


def measure() -> dict[str, tuple[float, str, str]]:
    """One lesson of a perfect learner; the process that renders the learner is the one that watches."""
    with tempfile.TemporaryDirectory() as folder:
        library, played = Library(Path(folder)), Teacher().dance(1)
        library.write_body(TeacherBody(**teacher_arrays()))
        about = About(played.name, len(played.quats) / played.fps, played.bpm, difficulty(played.joints_m, played.fps))
        library.write("dance_001", TaughtDance(about, played.fps, played.joints_m, played.quats, played.hips_m))
        notes = asyncio.run(_lesson(library))
    against = f"camera at 30 fps, {notes['dropped']} images dropped, rendering included"
    return {
        "teacher.fps": (notes["fps"], "images scored/s", against),
        "teacher.latency_ms_p95": (notes["age_ms_p95"], "ms, image to score", against),
        "teacher.verdict_ms_p95": (notes["verdict_ms_p95"], "ms, end of a move to the verdict on it", against),
    }


async def _lesson(library: Library) -> dict:
    crew = Crew(Settings(partial(open_source, None), "tracker"))
    member = crew.borrow()
    member.prepare(Lesson("dance_001", skill="perfect", to_s=SECONDS), library.dance("dance_001"))
    try:
        while True:
            kind, content, _ = await member.next()
            if kind == "ready":
                member.go(0.5)
            elif kind == "error":
                raise RuntimeError(content["text"])
            elif kind == "done":
                return content["notes"]
    finally:
        await asyncio.to_thread(crew.end)
