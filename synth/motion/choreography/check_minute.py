"""The script of `kpopnet check` as one move of a person who starts beside the camera's view, facing the camera's wall."""

from kpopnet.datasets.check_script import END_S, SCRIPT, step_s
from synth.motion.choreography.moves import Key, Move, arms, concat, lower, mirror, together, turning, upper
from synth.motion.choreography.pairs import walk
from synth.motion.choreography.vocabulary import LOWER

BPM = 120.0
"""Two steps a second, a usual cadence of walking."""

STEP_BACK_M = 0.35
"""How far behind the place to stand the feet are of the person who sits."""

SIT_KEYS = {"hips_z": -0.40, "drop": 0.43, "hips_pitch": -4.0}
SAT_S = (36.2, 39.0)
"""Between these seconds the person sits still."""

_STEPS = together(LOWER["march"], upper(Key(1, arms("hang"))))
_LEFT, _RIGHT, _ABOUT = turning(_STEPS, 90), turning(_STEPS, -90), turning(concat(_STEPS, _STEPS), 180)


def _rest(beats: float) -> Move:
    return upper(Key(beats, arms("hang")))


def _sitting(beats: float) -> Move:
    """Steps back, sits down, holds for so many beats, stands up and steps forward."""
    leaning = {"hips_z": -0.2, "drop": 0.16, "hips_pitch": 26.0}
    legs = lower(Key(1.5, leaning), Key(2, SIT_KEYS), Key(beats, SIT_KEYS), Key(1.5, leaning), Key(1.5, {}))
    hands = arms((24, 70, 0, 40), waist_bend=4)
    trunk = upper(Key(1.5, arms("low_front", waist_bend=16)), Key(2, hands), Key(beats, hands),
                  Key(1.5, arms("low_front", waist_bend=16)), Key(1.5, arms("hang")))  # fmt: skip
    return concat(walk(-STEP_BACK_M), together(legs, trunk), walk(STEP_BACK_M))


def check_minute(way_m: float, from_left: bool) -> Move:
    """The script, danced at BPM; the person comes from `way_m` metres to the right or left, and goes back there."""
    ways = concat(_RIGHT, walk(way_m), _LEFT), concat(_LEFT, walk(way_m), _ABOUT)
    raised = upper(Key(2, arms("up")), Key(3, arms("up")), Key(2, arms("hang")))
    parts = {
        "empty room": _rest(1), "come in": ways[0], "stand still": _rest(1), "turn": turning(concat(*[_STEPS] * 6), 360),
        "raise hands": raised, "sit": _sitting(7), "leave": ways[1], "come back": concat(walk(way_m), _LEFT),
    }  # fmt: skip
    timed = []
    for step in SCRIPT:
        start_s, end_s = step_s(step.name)
        left = (end_s - start_s) * BPM / 60 - parts[step.name].beats
        assert left >= 0, f"{step.name} lasts {left:g} beats less than it takes"
        timed += [parts[step.name], *([_rest(left)] if left else [])]
    move = concat(*timed)
    assert abs(move.beats - END_S * BPM / 60) < 1e-9, move.beats
    return mirror(move) if from_left else move
