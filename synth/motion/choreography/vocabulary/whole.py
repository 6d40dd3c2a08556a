"""Moves of the whole body: floor work, jumps and combinations."""

from synth.motion.choreography.moves import Key, Move, arms, concat, feet, flow, hits, repeat, step, together, upper
from synth.motion.choreography.vocabulary.lower import LOWER, WIDE

_LEFT_KNEE_DOWN = feet((0.10, -0.43), (0.12, 0.36), drop=0.425, left_foot_pitch=72, hips_pitch=4, right_foot_yaw=5)
_HEELS = feet((0.10, -0.34), (0.10, -0.34), drop=0.66, hips_z=-0.13, foot_pitch=75, hips_pitch=8)
_BOTH_KNEES = feet((0.10, -0.43), (0.10, -0.43), drop=0.425, foot_pitch=72, hips_pitch=3)
_DEEP = feet(drop=0.56, hips_z=-0.20, hips_pitch=26, foot_x=0.17)
_SEATED = feet(drop=0.82, hips_z=-0.62, hips_pitch=-16)
_HANDS_BEHIND = arms((52, -78, 20, 6), waist_bend=14)
_BENT_OVER = feet(drop=0.42, hips_z=0.05, hips_pitch=62)
_PLANK = feet(drop=0.57, hips_z=0.88, hips_pitch=71, foot_pitch=58)
_PRESS = arms((76, 88, 0, 4), wrist=-60, head_bend=-18)
_REACH_DOWN = arms((100, 88, 0, 12), wrist=-40, waist_bend=48, chest_bend=26, head_bend=-10)

WHOLE: dict[str, Move] = {
    "kneel_and_rise": Move(
        (Key(2, _LEFT_KNEE_DOWN), Key(4, _LEFT_KNEE_DOWN | {"hips_x": 0.02}), step(2)),
        (
            Key(2, arms("chest", "thigh", head_bend=18, waist_bend=10)),
            Key(1, arms("high_side", "hip", head_bend=-16), sharp=0.6),
            Key(1, arms("across", "hip", chest_twist=-14), sharp=0.6),
            Key(2, arms("side", head_twist=20)),
            Key(2, arms("hang")),
        ),
    ),
    "both_knees": Move(
        (
            Key(1.5, _LEFT_KNEE_DOWN),
            Key(1.5, _BOTH_KNEES),
            Key(2, _HEELS),
            Key(2, _BOTH_KNEES),
            Key(2, _LEFT_KNEE_DOWN),
            step(3),
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
        (Key(2, _DEEP), Key(2, _SEATED), Key(4, _SEATED | {"hips_pitch": -20}), Key(2, _DEEP), step(2)),
        (
            Key(2, arms("low_front", waist_bend=10)),
            Key(2, _HANDS_BEHIND),
            Key(1, _HANDS_BEHIND | arms("high_front", (52, -78, 20, 6)), sharp=0.7),
            Key(1, _HANDS_BEHIND, sharp=0.7),
            Key(1, _HANDS_BEHIND | arms((52, -78, 20, 6), "high_front"), sharp=0.7),
            Key(1, _HANDS_BEHIND, sharp=0.7),
            Key(2, arms("front", waist_bend=24, chest_bend=10)),
            Key(2, arms("hang")),
        ),
    ),
    "push_up": Move(
        (
            Key(2, _BENT_OVER),
            Key(2, _PLANK),
            Key(2, _PLANK | {"drop": 0.70, "hips_z": 0.93, "hips_pitch": 84}),
            Key(2, _PLANK),
            Key(2, _BENT_OVER),
            step(2),
        ),
        flow(2, _REACH_DOWN, _PRESS, _PRESS | arms((66, 40, -45, 100)), _PRESS, _REACH_DOWN, arms("hang")).upper,
    ),
    "floor_slap": Move(
        (step(2, **WIDE, drop=0.50, hips_z=-0.12, hips_pitch=48), step(2)),
        (
            Key(2, arms((92, 85, 0, 6), (70, -20, 0, 12), waist_bend=34, chest_bend=16, head_bend=-22), sharp=0.8),
            Key(2, arms("high_side", "hip", head_bend=-12)),
        ),
    ),
    "bow": Move(
        (step(1.5, hips_pitch=42, hips_z=-0.10, drop=0.02), step(0.5, hips_pitch=42, hips_z=-0.10, drop=0.02), step(2)),
        flow(2, arms("belly", "back", waist_bend=26, chest_bend=12, head_bend=20), arms("hang")).upper,
    ),
    "star_jump": Move(
        (
            step(1, drop=0.22, hips_pitch=20, hips_z=-0.06),
            step(1, (0.34, 0), (0.34, 0), air=0.28, foot_pitch=30),
            step(1, drop=0.20, hips_pitch=14, hips_z=-0.05),
            step(1),
        ),
        (Key(1, arms("back", waist_bend=14)), Key(1, arms("high_side", head_bend=-8)), Key(2, arms("hang"))),
    ),
    "spin_and_hit": together(
        LOWER["spin"],
        upper(
            Key(1, arms("low_side", "low_across", chest_twist=-20)),
            Key(2, arms("chest")),
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
