"""Runs the online path, raw depth of a room to a dance score, for a long time: memory and latency must stay flat.

    python -m tests.soak --minutes 60             # in real time, 30 frames per second
    python -m tests.soak --minutes 60 --fast      # the same 108,000 frames as fast as they go

The source is simulated: a dance of `eval_sim` in a furnished room, played forwards and backwards for ever, so that the person
never jumps. Each frame passes human extraction, tracker and online scorer. Every minute of the source's time a line shows
the resident memory and the latency per frame. Exit code 1 if the memory of the last tenth exceeds that of the second tenth by
more than 5 % and 10 MB, or the median latency by more than 25 %.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

import kpopnet  # noqa: F401  before torch: it sets how OpenMP's threads wait
from kpopnet.dance.online import OnlineScorer
from kpopnet.dance.performance import Performance
from kpopnet.finder.finder import PersonFinder
from kpopnet.tracker.tracker import Tracker
from synth.simulated.stand_ins import EvalSim, EvalSimConfig
from tests.helpers.stand_ins import film_of

FPS = 30.0
SOURCE_FRAMES = 300
MINUTE = round(60 * FPS)


def resident_mb(process: int | str = "self") -> float:
    """Resident memory of a process in megabytes, 0 of one that has ended."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return 0.0
    return int(status.split("VmRSS:")[1].split()[0]) / 1000 if "VmRSS:" in status else 0.0


def main() -> None:
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser("python -m tests.soak", description=__doc__, formatter_class=form)
    parser.add_argument("--minutes", type=int, default=60, help="of the source's time: %(default)s")
    parser.add_argument("--fast", action="store_true", help="do not wait for real time")
    given = parser.parse_args()

    film = film_of(EvalSim(EvalSimConfig()), 0, SOURCE_FRAMES)
    forth_and_back = np.concatenate([np.arange(SOURCE_FRAMES), np.arange(SOURCE_FRAMES)[::-1]])
    frames = given.minutes * MINUTE
    order = np.resize(forth_and_back, frames)
    scorer = OnlineScorer(Performance(film.joints_camera_m[order], np.arange(frames) / FPS))
    extractor, tracker = PersonFinder(film.camera), Tracker(film.camera)

    latency_ms, memory_mb, medians_ms, latest, found = np.zeros(MINUTE), [], [], None, 0
    began = time.perf_counter()
    for frame in range(frames):
        if not given.fast:
            time.sleep(max(0.0, began + frame / FPS - time.perf_counter()))
        start = time.perf_counter()
        humans = extractor.extract(film.depth_m[order[frame]])
        if humans:
            found += 1
            joints_m, confidence = tracker.track(max(humans, key=lambda human: human.depth_m.size).whole(film.camera))
            latest = scorer.update(joints_m, frame / FPS, confidence) or latest
        latency_ms[frame % MINUTE] = 1000 * (time.perf_counter() - start)
        if (frame + 1) % MINUTE == 0:
            memory_mb.append(resident_mb())
            medians_ms.append(float(np.median(latency_ms)))
            score = f"{latest.so_far:.0f}" if latest else "none"
            print(
                f"minute {len(memory_mb):3}: {memory_mb[-1]:7.1f} MB, {medians_ms[-1]:5.2f} ms in the median, "
                f"{np.percentile(latency_ms, 95):5.2f} at the 95th percentile; person in {found} frames, score {score}",
                flush=True,
            )
    tenth = max(len(memory_mb) // 10, 1)
    early, late = np.median(memory_mb[tenth : 2 * tenth] or memory_mb), np.median(memory_mb[-tenth:])
    slower = np.median(medians_ms[-tenth:]) / np.median(medians_ms[tenth : 2 * tenth] or medians_ms)
    print(f"memory {early:.1f} MB early, {late:.1f} MB late; latency {slower:.2f} times that of the second tenth")
    sys.exit(bool(late > 1.05 * early and late > early + 10) or bool(slower > 1.25))


if __name__ == "__main__":
    main()
