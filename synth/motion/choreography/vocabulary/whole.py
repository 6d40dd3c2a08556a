"""Moves of the whole body: floor work, jumps and combinations."""

from synth.motion.choreography.moves import Key, Move, arm, arms, concat, feet, flow, hits, repeat, together, upper
from synth.motion.choreography.vocabulary.lower import HOME, LOWER, WIDE

_LEFT_KNEE_DOWN = feet((0.10, -0.43), (0.12, 0.36), drop=0.425, left_foot_pitch=72, hips_pitch=4, right_foot_yaw=5)
_HEELS = feet((0.10, -0.34), (0.10, -0.34), drop=0.66, hips_z=-0.13, left_foot_pitch=75, right_foot_pitch=75, hips_pitch=8)
_BOTH_KNEES = feet((0.10, -0.43), (0.10, -0.43), drop=0.425, left_foot_pitch=72, right_foot_pitch=72, hips_pitch=3)
_DEEP = {"drop": 0.56, "hips_z": -0.20, "hips_pitch": 26, "left_foot_x": 0.17, "right_foot_x": 0.17}
_SEATED = {"drop": 0.82, "hips_z": -0.62, "hips_pitch": -16}
_HANDS_BEHIND = {
    f"{side}_{a}": v for side in ("left", "right") for a, v in (("raise", 52), ("plane", -78), ("twist", 20), ("elbow", 6))
} | {"waist_bend": 14}
_PLANK = {"drop": 0.57, "hips_z": 0.88, "hips_pitch": 71, "left_foot_pitch": 58, "right_foot_pitch": 58}
_PRESS = {
    "left_raise": 76,
    "right_raise": 76,
    "left_plane": 88,
    "right_plane": 88,
    "left_elbow": 4,
    "right_elbow": 4,
    "left_wrist": -60,
    "right_wrist": -60,
    "head_bend": -18,
}
_REACH_DOWN = {
    "waist_bend": 48,
    "chest_bend": 26,
    "left_raise": 100,
    "right_raise": 100,
    "left_plane": 88,
    "right_plane": 88,
    "left_wrist": -40,
    "right_wrist": -40,
    "head_bend": -10,
}

WHOLE: dict[str, Move] = {
    "kneel_and_rise": Move(
        (Key(2, _LEFT_KNEE_DOWN), Key(4, _LEFT_KNEE_DOWN | {"hips_x": 0.02}), Key(2, HOME)),
        (
            Key(2, arms("chest", "thigh", head_bend=18, waist_bend=10)),
            Key(1, arms("high_side", "hip", head_bend=-16), sharp=0.6),
            Key(1, arms("across", "hip", chest_twist=-14), sharp=0.6),
            Key(2, arms("side", "side", head_twist=20)),
            Key(2, arms("hang")),
        ),
    ),
    "both_knees": Move(
        (
            Key(1.5, _LEFT_KNEE_DOWN),
            Key(1.5, _BOTH_KNEES),
            Key(2, _HEELS),
            Key(2, _BOTH_KNEES),
            Key(2, _LEFT_KNEE_DOWN | {"hips_x": 0.0}),
            Key(3, HOME),
        ),
        (
            Key(3, arms("low_side", waist_bend=8)),
            Key(2, arms("across", waist_bend=22, chest_bend=14, head_bend=24)),
            Key(2, arms("high_side", chest_bend=-12, head_bend=-24)),
            Key(2, arms("chest", "low_side")),
            Key(3, arms("hang")),
        ),
    ),
    "sit_and_rise": Move(
        (Key(2, _DEEP), Key(2, _SEATED), Key(4, _SEATED | {"hips_pitch": -20}), Key(2, _DEEP), Key(2, HOME)),
        (
            Key(2, arms("low_front", waist_bend=10)),
            Key(2, _HANDS_BEHIND),
            Key(1, _HANDS_BEHIND | arm("left", "high_front"), sharp=0.7),
            Key(1, _HANDS_BEHIND, sharp=0.7),
            Key(1, _HANDS_BEHIND | arm("right", "high_front"), sharp=0.7),
            Key(1, _HANDS_BEHIND, sharp=0.7),
            Key(2, arms("front", waist_bend=24, chest_bend=10)),
            Key(2, arms("hang")),
        ),
    ),
    "push_up": Move(
        (
            Key(2, {"drop": 0.42, "hips_z": 0.05, "hips_pitch": 62}),
            Key(2, _PLANK),
            Key(2, _PLANK | {"drop": 0.70, "hips_z": 0.93, "hips_pitch": 84}),
            Key(2, _PLANK),
            Key(2, {"drop": 0.42, "hips_z": 0.05, "hips_pitch": 62}),
            Key(2, HOME),
        ),
        (
            Key(2, _REACH_DOWN),
            Key(2, _PRESS),
            Key(
                2,
                _PRESS
                | {
                    "left_raise": 66,
                    "right_raise": 66,
                    "left_plane": 40,
                    "right_plane": 40,
                    "left_elbow": 100,
                    "right_elbow": 100,
                    "left_twist": -45,
                    "right_twist": -45,
                },
            ),
            Key(2, _PRESS),
            Key(2, _REACH_DOWN),
            Key(2, arms("hang")),
        ),
    ),
    "floor_slap": Move(
        (Key(2, WIDE | {"drop": 0.50, "hips_z": -0.12, "hips_pitch": 48}), Key(2, HOME)),
        (
            Key(
                2,
                {
                    "waist_bend": 34,
                    "chest_bend": 16,
                    "left_raise": 92,
                    "left_plane": 85,
                    "left_elbow": 6,
                    "right_raise": 70,
                    "right_plane": -20,
                    "head_bend": -22,
                },
                sharp=0.8,
            ),
            Key(2, arms("high_side", "hip", head_bend=-12)),
        ),
    ),
    "bow": Move(
        (
            Key(1.5, {"hips_pitch": 42, "hips_z": -0.10, "drop": 0.02}),
            Key(0.5, {"hips_pitch": 42, "hips_z": -0.10, "drop": 0.02}),
            Key(2, HOME),
        ),
        (Key(2, arms("belly", "back", waist_bend=26, chest_bend=12, head_bend=20)), Key(2, arms("hang"))),
    ),
    "star_jump": Move(
        (
            Key(1, {"drop": 0.22, "hips_pitch": 20, "hips_z": -0.06}),
            Key(1, feet((0.34, 0), (0.34, 0), air=0.28, left_foot_pitch=30, right_foot_pitch=30)),
            Key(1, {"drop": 0.20, "hips_pitch": 14, "hips_z": -0.05}),
            Key(1, HOME),
        ),
        (Key(1, arms("back", waist_bend=14)), Key(1, arms("high_side", head_bend=-8)), Key(2, arms("hang"))),
    ),
    "spin_and_hit": together(
        LOWER["spin"],
        upper(
            Key(1, arms("low_side", "low_across", chest_twist=-20)),
            Key(2, arms("chest", "chest")),
            Key(1, arms("high_side", "low_side", waist_side=-8, head_bend=-8), sharp=0.7),
        ),
    ),
    "kick_and_punch": together(
        LOWER["front_kicks"],
        repeat(
            concat(
                hits(1, arms("guard"), arms("low_side", "guard", chest_bend=10)),
                hits(1, arms("guard"), arms("front", "guard")),
            ),
            2,
        ),
    ),
    "fan_kick": together(
        LOWER["high_kicks"],
        repeat(flow(1, arms("low_side"), arms("side", waist_bend=10), arms("low_side"), arms("hang")), 2),
    ),
}
"""Moves of the whole body by name. Their lower tracks need their own upper tracks."""
