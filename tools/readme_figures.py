"""Draws the two figures at the top of README.md.

    python tools/readme_figures.py --real /data/UTD-MHAD --simulated data/eval_sim --dances data/kpop_sim

Estimates: the network of the package (mode best), on sequences at even distances in each set, the frame in the middle of each.
Score: the best and the worst learner of the first dance, on true joints.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np
from matplotlib.figure import Figure

from kpopnet.dance.scoring import SCORERS, score_dance
from kpopnet.datasets.dances.dance_set import open_set
from kpopnet.datasets.protocol import evenly_spaced
from kpopnet.evaluation.registry import BENCHMARKS
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.pose.extraction import extract_person
from kpopnet.pose.person import PersonEstimator
from kpopnet.viz.drawing import ESTIMATED, TRUE, person_tile, save_png, sheet

TILES = 4
FIGURES = Path(__file__).resolve().parents[1] / "docs" / "figures"


def tiles(name: str, folder: Path) -> list[np.ndarray]:
    """The middle frame of TILES sequences with true and estimated joints over the depth of the person."""
    settings, reader = BENCHMARKS[name]
    benchmark = reader(settings(name=name, path=str(folder)))
    found = []
    for sequence in map(benchmark.read, evenly_spaced(benchmark.sequence_names(), TILES)):
        camera, truth_m = sequence.camera, sequence.joints_camera_m
        person_m = sequence.depth_m if sequence.is_segmented else extract_person(sequence.depth_m, camera)
        joints_m, _ = PersonEstimator(NetworkEstimator(), "best").estimate(person_m, camera)
        middle = len(person_m) // 2
        skeletons = (truth_m[middle], TRUE), (joints_m[middle], ESTIMATED)
        found.append(person_tile(person_m[middle], camera, skeletons, 280, (f"{sequence.name}, frame {middle}",)))
    return found


def estimates(real: Path, simulated: Path) -> np.ndarray:
    rows = [
        ("REAL Kinect v1 depth (UTD-MHAD), true: Kinect SDK labels", tiles("utd_mhad", real)),
        ("SIMULATED depth (eval_sim), true: exact", tiles("eval_sim", simulated)),
    ]
    return sheet(rows, (TRUE, ESTIMATED), "The network of the package; frames in the middle of four sequences each")


def dance_score(folder: Path) -> Figure:
    dances = open_set(BENCHMARKS["kpop_sim"][0](name="kpop_sim", path=str(folder)))
    dance = dances.dance(dances.names[0])
    figure = Figure(figsize=(10, 2.6), layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for panel, learner, rank in zip(panels, (dance.learners[0], dance.learners[-1]), ("best", "worst"), strict=True):
        score = score_dance(dance.teacher(), learner.joints(), SCORERS["dance22"])
        windows = score.windows
        panel.plot(windows.start_s, windows.similarity, color="black", linewidth=2, label="similarity")
        panel.plot(windows.start_s, windows.timing, color="tab:blue", linewidth=1, label="timing")
        panel.plot(windows.start_s, windows.posture, color="tab:orange", linewidth=1, label="posture")
        panel.set_title(f"SIMULATED {dance.name}, the {rank} of four learners: {score.similarity:.0f} of 100", fontsize=10)
        panel.set_xlabel("start of the 2 s window, s")
        panel.set_ylim(0, 101)
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("score")
    panels[1].legend(fontsize=8, loc="lower right", ncols=3)
    return figure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--real", type=Path, required=True, help="folder of UTD-MHAD")
    parser.add_argument("--simulated", type=Path, default=Path("data/eval_sim"), help="folder of eval_sim: %(default)s")
    parser.add_argument("--dances", type=Path, default=Path("data/kpop_sim"), help="folder of kpop_sim: %(default)s")
    given = parser.parse_args()
    cv2.setNumThreads(1)
    save_png(FIGURES / "estimates.png", estimates(given.real, given.simulated))
    dance_score(given.dances).savefig(FIGURES / "dance_score.png", dpi=100)
    print(f"look at {FIGURES / 'estimates.png'} and {FIGURES / 'dance_score.png'}")


if __name__ == "__main__":
    main()
