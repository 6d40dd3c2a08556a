"""A simulated learner who dances live before a depth camera: the stand-in for a camera and a person.

The learner knows a dance as rotations of the bones of the body of `synth`, and dances it as well as a level of
`synth.dances.skill` says, or with one fault put in.
"""

from dataclasses import replace

import numpy as np

from kpopnet.camera import CAMERAS, Camera
from kpopnet.errors import InputError
from kpopnet.rotations import normalised, towards
from synth.body.asset import load_body
from synth.body.shape import BodyConfig, Person, draw_person
from synth.dances.faults import end_motion, on_the_floor
from synth.dances.skill import LEVELS, SkillConfig, draw_strengths, learn
from synth.motion.posture import CHANNELS, STANDING, rotations
from synth.motion.skeleton import INDEX, LEG_M, Motion
from synth.motion.skeleton import JOINT_NAMES as MOTION_BONES
from synth.motion.splice import at_times
from synth.scene.room import ViewConfig, draw_room, draw_view
from synth.sensor.film_noise import FilmNoise
from synth.sensor.model import SENSORS
from synth.simulated.film import Played, Studio, Take, measure_frame

ON_THE_BEAT = "an arm on every beat"
"""The skill of a person who raises the left arm highest at every second, to measure a latency by."""

SKILLS = ("perfect", *LEVELS, "waving", "still", "absent")
FAULTS = ("", "left arm", "right arm", "left leg", "right leg", "late", "hidden feet")
LATE_S = 0.35
FAULT_WEIGHT = 0.85  # how far a faulty limb hangs: 1 for as in standing still

CAMERA = CAMERAS["kinect_v1"]
VIEW = ViewConfig(height_m=(1.0, 1.2), aim_m=(0.95, 1.05), roll_deg=0.5)
PLACE_TRIES = 16
STEPS = (1.0, 0.5, 0.0)
"""A learner for whom the camera's view is too small takes smaller steps, in the end none: the pose is what is scored."""
NEAR_M, FAR_M = 1.3, 2.6
"""Distances from the camera of a learner whose feet it does not see, and of one who finds no place, metres."""
CURLS_RAD = np.array([0.3, 0.3])
AWAY_M = np.array([50.0, 50.0, 0.0])  # where a person is whom the camera does not see
LIMBS = {"arm": ("Shoulder", "Arm", "ForeArm", "Hand"), "leg": ("UpLeg", "Leg", "Foot")}


class LiveLearner:
    """A learner of one dance in a room before a camera."""

    def __init__(
        self,
        quats: np.ndarray,
        hips_m: np.ndarray,
        fps: float,
        skill: str,
        fault: str = "",
        seed: int = 0,
        camera: Camera = CAMERA,
        people_of: str = "train",
    ) -> None:
        """Learns a dance, (T, B, 4) rotations of the bones of `synth`'s body and (T, 3) positions of the hips in metres.

        `skill` is one of SKILLS, or ON_THE_BEAT, `fault` one of FAULTS; the seed is of the person, the room and the errors. The
        camera's noise is that of a Kinect v1. `people_of` is as of `synth.body.shape.draw_person`.
        """
        if skill not in (*SKILLS, ON_THE_BEAT) or fault not in FAULTS:
            raise InputError(
                f"skill={skill}, fault={fault}: expected one of {', '.join(SKILLS)} and one of {', '.join(FAULTS[1:])}"
            )
        if quats.shape[1:] != (len(load_body().bone_names), 4):
            raise InputError(f"rotations of shape {quats.shape}: made for another body; make the dances again")
        self.camera = camera
        self._studio, self._empty = Studio(camera, "cpu"), skill == "absent"
        rng = np.random.default_rng([seed, 1])
        motion = learned(motion_of(quats, hips_m, fps), skill, fault, rng)
        person = draw_person(np.random.default_rng([seed, 3]), BodyConfig(), people_of)
        self._take, self._fps = self._placed(motion, fault, person, seed), fps
        self._noise, self._shown = FilmNoise((*b"live", seed)), 0
        self._room_m = self._studio.furnish(self._take.room, self._take.view)

    def frame(self, dance_s: float) -> np.ndarray:
        """(H, W) float32 depth of the whole room, metres, 0: not measured, at a time of the dance, seconds.

        Before the start and after the end the learner stands.
        """
        take = self._take
        number = int(np.clip(round(dance_s * self._fps), 0, len(take) - 1))
        self._studio.pose(take.played, number, take.place_m + (AWAY_M if self._empty else 0.0))
        clean = self._studio.clean_frame(self._shown, self._room_m)
        self._shown += 1
        return measure_frame(clean, self.camera, SENSORS["kinect_v1"], self._noise)[0]

    def true_joints_m(self) -> np.ndarray:
        """(15, 3) float32 true joints of the latest image, metres, in the camera's frame."""
        return self._take.view.to_camera(self._studio.scene.joints_world_m()).astype(np.float32)

    def _placed(self, motion: Motion, fault: str, person: Person, seed: int) -> Take:
        """The learner in an empty room, see `placed`; with hidden feet, too near."""
        rng = np.random.default_rng([seed, 2])
        if fault == "hidden feet":
            return _before(rng, self._studio.play(person, motion, 0.0, CURLS_RAD), NEAR_M)
        return placed(self._studio, person, motion, rng)


def placed(studio: Studio, person: Person, motion: Motion, rng: np.random.Generator) -> Take:
    """A dancer in an empty room, the whole dance in view where there is such a place, with smaller steps if need be."""
    for share in STEPS:
        played = studio.play(person, _with_steps(motion, share), 0.0, CURLS_RAD)
        take = studio.place_in_rooms(rng, played, VIEW, PLACE_TRIES, furniture=())
        if take is not None:
            return take
    return _before(rng, played, FAR_M)


def _before(rng: np.random.Generator, played: Played, distance_m: float) -> Take:
    """A dancer in an empty room, so far in front of the camera."""
    view, room = draw_view(rng, VIEW), draw_room(rng, ())
    return Take(played, room, view, np.array([0.0, distance_m, 0.0]))


def _with_steps(motion: Motion, share: float) -> Motion:
    """The motion with this share of its way over the floor, from where it begins."""
    root_m = motion.root_m.copy()
    root_m[:, (0, 2)] = root_m[0, (0, 2)] + share * (root_m[:, (0, 2)] - root_m[0, (0, 2)])
    return replace(motion, root_m=root_m)


def motion_of(quats: np.ndarray, hips_m: np.ndarray, fps: float) -> Motion:
    """The motion of which `synth.samples.sampler.body_rotations` makes these (T, B, 4) rotations; (T, 3) hips in metres."""
    bones = [load_body().bone(name) for name in MOTION_BONES]
    # From z up, -y in front to y up, z in front: (x, y, z) -> (x, z, -y).
    turned = quats[:, bones][..., (0, 1, 3, 2)] * (1, 1, 1, -1)
    root_m = hips_m[:, (0, 2, 1)] * (1, 1, -1)
    return Motion(turned.astype(np.float32), root_m.astype(np.float32), fps, "taught", LEG_M)


def learned(motion: Motion, skill: str, fault: str, rng: np.random.Generator) -> Motion:
    """A learner's motion of a teacher's, with the skill of SKILLS and the fault of FAULTS."""
    if skill in LEVELS:
        motion, _ = learn(motion, draw_strengths(rng, LEVELS.index(skill), SkillConfig()), rng)
    times_s = np.arange(len(motion)) / motion.fps
    if skill == "waving":
        motion = end_motion("waving", motion, motion, rng)
    if skill == ON_THE_BEAT:
        motion = _on_the_beat(motion)
    if skill in ("still", "absent"):
        motion = at_times(motion, np.zeros_like(times_s), motion.fps)
    if fault == "late":
        motion = at_times(motion, np.maximum(times_s - LATE_S, 0.0), motion.fps)
    side, _, limb = fault.partition(" ")
    if limb in LIMBS:
        motion = _hanging(motion, [INDEX[f"{side.capitalize()}{bone}"] for bone in LIMBS[limb]])
    return motion


def _on_the_beat(motion: Motion) -> Motion:
    """A motion as long as another, of a person who raises an arm."""
    seconds = np.arange(len(motion)) / motion.fps
    postures = np.repeat(STANDING[None], len(seconds), axis=0)
    postures[:, CHANNELS["left_raise"]] = 90 + 70 * np.cos(2 * np.pi * seconds)
    return on_the_floor(postures, motion, ON_THE_BEAT)


def _hanging(motion: Motion, bones: list[int]) -> Motion:
    """The motion with these bones near those of a person who stands."""
    quats = motion.quats.astype(np.float64)
    rest = rotations(STANDING[None]).astype(np.float64)[0]
    quats[:, bones] = normalised(towards(quats[:, bones], rest[bones], FAULT_WEIGHT))
    return replace(motion, quats=quats.astype(np.float32))
