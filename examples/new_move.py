"""From a new move to a dance: written in the language of moves, performed by a simulated person, rendered as depth.

    python examples/new_move.py dance.png --joints dance.npz

Change `NEW_MOVE`. `synth/motion/choreography/moves.py` describes the language; the moves that dances are composed of stand in
`synth/motion/choreography/vocabulary.py`.
"""

import argparse
from pathlib import Path

import numpy as np

from kpopnet.camera import CAMERAS
from kpopnet.viz.drawing import TRUE, person_tile, save_png, sheet
from synth.body.shape import BodyConfig, draw_person
from synth.motion.choreography.moves import Key, both_sides, concat, feet, hits, lower, repeat, together
from synth.motion.choreography.stage import perform
from synth.motion.choreography.vocabulary import LOWER, UPPER
from synth.scene.room import Room, View
from synth.simulated.film import Studio, Take

BPM, FPS, FRAMES_SHOWN = 116, 30.0, 8

# A step to the left on beat 1, a knee lift on beat 2; the arms swing up and hit the sides.
STEP = lower(
    Key(1, feet((0.30, 0.0), (0.12, 0.0), hips_x=0.12, drop=0.06), anchor="right"),
    Key(1, {"left_foot_x": 0.12, "right_foot_y": 0.25, "right_foot_z": 0.10, "hips_x": 0.05}, anchor="left"),
)
ARMS = hits(1, {"left_raise": 150, "right_raise": 150}, {"left_raise": 80, "right_raise": 80})
NEW_MOVE = both_sides(together(STEP, ARMS))

DANCE = concat(repeat(NEW_MOVE, 2), together(LOWER["bounce"], UPPER["hanging"]))
"""The new move twice, then two moves of the vocabulary, one for the feet and one for the arms."""

VIEW = View(np.array([0.0, -2.8, 1.0]), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))
"""A level camera 2.8 m in front of the dancer, 1 m above the floor."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figure", type=Path, help="the PNG to write: depth and joints of some frames")
    parser.add_argument("--joints", type=Path, help="an .npz to write, a teacher for examples/recordings_to_score.py")
    given = parser.parse_args()

    frames = round(DANCE.beats * 60 / BPM * FPS) + 1
    motion = perform(DANCE, BPM, frames, FPS, "new move")
    camera = CAMERAS["kinect_2"]
    studio = Studio(camera, "cpu")
    person = draw_person(np.random.default_rng(0), BodyConfig(), "train")
    played = studio.play(person, motion, yaw_rad=0.0, curls_rad=np.zeros(2))
    empty = Room(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    clean = list(studio.render(Take(played, empty, VIEW, np.zeros(3)), range(frames)))

    chosen = [clean[k] for k in np.linspace(0, frames - 1, FRAMES_SHOWN).astype(int)]
    tiles = [
        person_tile(one.person_m, camera, ((one.joints_camera_m, TRUE),), 240, (f"{one.number / FPS:.1f} s",)) for one in chosen
    ]
    save_png(given.figure, sheet([("", tiles[:4]), ("", tiles[4:])], (TRUE,), f"{DANCE.beats:g} beats at {BPM} a minute"))
    print(f"{frames} frames; look at {given.figure}")
    if given.joints:
        joints_m = np.stack([one.joints_camera_m for one in clean])
        np.savez_compressed(given.joints, joints_m=joints_m, times_s=np.arange(frames) / FPS)
        print(f"joints: {given.joints}")


if __name__ == "__main__":
    main()
