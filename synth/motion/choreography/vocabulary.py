"""The vocabulary of dance moves, in the language of `moves`: of the feet and hips, of trunk and arms, and of the whole body."""

from synth.motion.choreography.moves import (
    Key,
    Move,
    arms,
    both_sides,
    concat,
    feet,
    flow,
    hits,
    lower,
    mirror,
    repeat,
    step,
    together,
    upper,
)

WIDE = feet(foot_x=0.24, foot_yaw=18)

_side_step = lower(
    step(1, (0.27, 0), (0.27, 0), hips_x=0.10, drop=0.05, anchor="right"),
    step(1, foot_x=0.10, drop=0.01, anchor="left"),
)
_march_step = lower(
    step(0.5, left_foot_y=0.22, left_foot_z=0.12, left_foot_pitch=25, hips_x=-0.05, hips_roll=-3),
    step(0.5, drop=0.03),
)
_front_step = lower(
    step(1, (0.1, 0.17), (0.1, -0.17), drop=0.05, hips_z=0.05, right_foot_pitch=22, anchor="right"),
    step(1, (0.1, 0), (0.1, 0), anchor="left"),
)
_back_step = lower(
    step(1, (0.1, -0.16), (0.1, 0.16), drop=0.05, hips_z=-0.03, anchor="right"),
    step(1, (0.1, 0), (0.1, 0), anchor="left"),
)
_front_kick = lower(
    step(1, (0.1, -0.12), (0.1, 0.08), drop=0.06, hips_x=-0.05, left_foot_pitch=25, left_foot_y=0.05),
    step(1, (0.06, 0.95), (0.12, 0), left_foot_y=0.66, left_foot_pitch=-25, hips_x=-0.09, hips_pitch=-14),
    step(1, (0.06, 0.15), (0.12, 0), left_foot_y=0.30, left_foot_pitch=20, hips_x=-0.09, drop=0.03),
    step(1),
)
_high_kick = lower(
    step(1, (0.1, -0.15), (0.1, 0.08), drop=0.08, hips_x=-0.05, left_foot_pitch=25, left_foot_y=0.05),
    step(1, (0.05, 0.80), (0.12, 0), left_foot_y=1.22, left_foot_pitch=-55, hips_x=-0.10, hips_z=0.04, hips_pitch=-24),
    step(1, (0.06, 0.2), (0.12, 0), left_foot_y=0.35, left_foot_pitch=15, hips_x=-0.09, drop=0.03),
    step(1),
)
_side_kick = lower(
    step(1, (0.12, 0.15), (0.1, 0), left_foot_y=0.42, left_foot_pitch=25, hips_x=-0.08, left_knee_out=30),
    step(1, (0.86, 0.1), (0.1, 0), left_foot_y=0.66, hips_x=-0.10, hips_roll=-24, left_foot_yaw=0),
    step(1, (0.14, 0.12), (0.1, 0), left_foot_y=0.32, left_foot_pitch=20, hips_x=-0.08, left_knee_out=20),
    step(1),
)
_knee_lift = lower(
    step(1, (0.08, 0.22), (0.12, 0), left_foot_y=0.42, left_foot_pitch=30, hips_x=-0.08, hips_pitch=-4, sharp=0.7),
    step(1, drop=0.05),
)
_hip_bump = step(0.5, **WIDE, hips_x=0.10, hips_roll=11, drop=0.05)
_quarter_spin = step(0.5, (0.08, 0), (0.06, 0.10), hips_x=0.06, right_foot_y=0.13, right_foot_pitch=30, turn=90, anchor="left")

LOWER: dict[str, Move] = {
    "bounce": lower(step(0.5, drop=0.06), step(0.5, drop=0.01)),
    "sway": both_sides(lower(step(1, hips_x=0.08, hips_roll=9, drop=0.03, right_knee_out=6))),
    "hip_bumps": lower(_hip_bump, step(0.5, **WIDE, drop=0.06), _hip_bump, step(0.5, drop=0.04)),
    "hip_circle": lower(
        step(1, **WIDE, hips_x=0.09, drop=0.07, hips_roll=90 * 0.09),
        step(1, **WIDE, hips_z=0.09, drop=0.07, hips_pitch=120 * 0.09),
        step(1, **WIDE, hips_x=-0.09, drop=0.07, hips_roll=-90 * 0.09),
        step(1, drop=0.03),
    ),
    "twist_hips": both_sides(lower(step(0.5, hips_yaw=24, drop=0.07, left_foot_yaw=-4), step(0.5, drop=0.03))),
    "side_steps": both_sides(_side_step),
    "double_side_steps": both_sides(repeat(_side_step, 2)),
    "march": both_sides(_march_step),
    "walk_and_back": concat(_front_step, mirror(_front_step), _back_step, mirror(_back_step)),
    "taps_out": both_sides(
        lower(step(1, (0.36, 0.05), (0.10, 0), hips_x=-0.06, drop=0.05, left_foot_pitch=15, hips_roll=-5), step(1, drop=0.02))
    ),
    "taps_front": both_sides(
        lower(step(1, (0.08, 0.32), (0.12, 0), hips_x=-0.04, drop=0.06, left_foot_pitch=-18), step(1, drop=0.02))
    ),
    "grapevine": both_sides(
        lower(
            step(1, (0.25, 0), (0.25, 0), drop=0.05, hips_x=0.06, anchor="right"),
            step(1, (0.13, 0.11), (-0.13, -0.11), drop=0.06, hips_yaw=-12, anchor="left"),
            step(1, (0.25, 0), (0.25, 0), drop=0.05, hips_x=0.06, anchor="right"),
            step(1, drop=0.02, anchor="left"),
        )
    ),
    "squats": lower(
        step(1, **WIDE, drop=0.30, hips_z=-0.14, hips_pitch=24, sharp=0.8),
        step(1, **WIDE, drop=0.04),
        step(1, **WIDE, drop=0.34, hips_z=-0.15, hips_pitch=26, sharp=0.8),
        step(1, drop=0.02),
    ),
    "drop_low": lower(
        step(2, drop=0.52, hips_z=-0.16, hips_pitch=20, foot_x=0.2, knee_out=18, foot_yaw=22), step(2, drop=0.02)
    ),
    "lunges": both_sides(
        lower(
            step(1, (0.50, 0.06), (0.16, 0), hips_x=0.22, drop=0.22, hips_pitch=8, left_foot_yaw=30, left_knee_out=10),
            step(1, drop=0.03),
        )
    ),
    "front_lunge": both_sides(
        lower(step(1, (0.1, 0.42), (0.12, -0.12), drop=0.25, hips_z=0.14, right_foot_pitch=38), step(1, drop=0.03))
    ),
    "front_kicks": both_sides(_front_kick),
    "high_kicks": both_sides(_high_kick),
    "side_kicks": both_sides(_side_kick),
    "knee_lifts": both_sides(_knee_lift),
    "hops": lower(
        step(0.5, drop=0.12, hips_pitch=8),
        step(0.5, air=0.13, foot_pitch=30),
        step(0.5, drop=0.12, hips_pitch=6),
        step(0.5, drop=0.01),
    ),
    "jump_apart": lower(
        step(0.5, drop=0.14, hips_pitch=10),
        step(0.5, **WIDE, air=0.15, foot_pitch=25),
        step(1, **WIDE, drop=0.14, hips_pitch=8),
        step(0.5, air=0.10, foot_pitch=20),
        step(0.5, drop=0.09),
        step(1, drop=0.01),
    ),
    "step_turn": lower(
        step(1, foot_x=0.11, drop=0.04, turn=90, anchor="left"),
        step(1, foot_x=0.11, drop=0.02, turn=90, anchor="right"),
        step(1, foot_x=0.11, drop=0.04, turn=90, anchor="left"),
        step(1, foot_x=0.11, drop=0.01, turn=90, anchor="right"),
    ),
    "spin": lower(step(1, drop=0.08, hips_yaw=-20, right_foot_x=0.2), *[_quarter_spin] * 4, step(1, drop=0.07)),
    "pivot_half_turns": lower(
        step(1, (0.1, 0.16), (0.1, -0.16), drop=0.05, anchor="right"),
        step(1, (0.1, -0.16), (0.1, 0.16), drop=0.05, turn=-180, anchor="left"),
        step(1, (0.1, 0.16), (0.1, -0.16), drop=0.05, anchor="right"),
        step(1, turn=-180, anchor="left"),
    ),
}
"""Moves of the feet and hips by name. Each starts and ends standing relaxed, so that any two can be concatenated."""

UPPER: dict[str, Move] = {
    "point_up": both_sides(
        hits(1, arms("high_side", "hip", waist_side=-8, head_twist=20, head_bend=-15), arms("chest", "hip"))
    ),
    "point_front": both_sides(hits(1, arms("front", "hip", chest_twist=-14), arms("pull", "hip", chest_twist=12))),
    "point_across": both_sides(
        hits(1, arms("high_across", "hang", chest_twist=-18, head_twist=-25), arms("low_side", "hang", chest_twist=12))
    ),
    "disco": both_sides(
        hits(1, arms("hip", "high_side", head_twist=-25), arms("hip", "low_across", waist_bend=8, head_twist=15))
    ),
    "double_wave": flow(
        1,
        arms("high_side", "up", chest_side=8, waist_side=8, head_side=6),
        arms("up", "high_side", chest_side=-8, waist_side=-8, head_side=-6),
    ),
    "arm_wave": both_sides(
        flow(
            0.5,
            arms("side", left_wrist=45, left_elbow=15),
            arms("side", left_elbow=55, left_twist=45, left_wrist=-20, left_raise=80),
            arms("side", left_shrug=18, left_raise=70, chest_side=-6),
            arms("side", chest_bend=10, chest_side=0),
        )
    ),
    "body_roll": flow(
        1,
        arms("hang", chest_bend=-15, waist_bend=-4, head_bend=-16),
        arms("hang", chest_bend=-6, waist_bend=-16, head_bend=2),
        arms("low_front", chest_bend=18, waist_bend=2, head_bend=12),
        arms("hang", chest_bend=4, waist_bend=10, head_bend=4),
    ),
    "chest_pops": hits(
        0.5, arms("loaded", chest_bend=-17, head_bend=6), arms("loaded", chest_bend=14, head_bend=-4), sharp=0.8
    ),
    "shoulder_shimmy": both_sides(
        hits(0.5, arms("low_side", chest_twist=20, left_shrug=14), arms("low_side", chest_twist=-10), sharp=0.9)
    ),
    "shrugs": both_sides(hits(1, arms("hang", head_side=12, left_shrug=20, left_elbow=35))),
    "crossed_punches": hits(1, arms("across", "guard", chest_twist=-20), arms("guard", "across", chest_twist=20), sharp=0.5),
    "cross_and_open": hits(
        1,
        arms("across", waist_bend=8, head_bend=10, right_raise=92),
        arms("high_side", chest_bend=-10, head_bend=-12),
        arms("low_across", waist_bend=12, right_raise=42),
        arms("side"),
    ),
    "fold_arms": flow(
        1,
        arms("folded", right_raise=74, right_elbow=84, head_bend=4),
        arms("folded", right_raise=74, right_elbow=84, head_twist=25),
        arms("folded", right_raise=74, right_elbow=84, head_twist=-25),
        arms("hang"),
    ),
    "punches_front": both_sides(hits(1, arms("front", "guard", chest_twist=-20), sharp=0.5)),
    "punches_up": both_sides(hits(1, arms("up", "guard", waist_side=-6, head_bend=-12), sharp=0.6)),
    "heart": hits(2, arms("head_top", head_side=10), arms("hang"), sharp=0.5),
    "gwiyomi": both_sides(hits(1, arms("ear", "hip", head_side=16), arms("mouth", "hip", head_side=-8), sharp=0.6)),
    "salute": both_sides(hits(1, arms("brow", "hip", head_twist=15), arms("low_front", "hip"), sharp=0.5)),
    "hands_up": hits(1, arms("up", head_bend=-15, chest_bend=-8), arms("goalpost"), sharp=0.7),
    "claps": hits(1, arms("frame", plane=105, elbow=60), arms("low_side"), sharp=0.6),
    "robot": both_sides(
        hits(1, arms("goalpost", "scarecrow", head_twist=30), arms("scarecrow", "goalpost", head_twist=0), sharp=0.35)
    ),
    "windmill": flow(
        1, arms("side", "hang"), arms("up", "side", waist_side=-8), arms("side", "up", waist_side=8), arms("hang", "side")
    ),
    "swim": both_sides(flow(1, arms("front", "pull", waist_bend=12, chest_twist=-12))),
    "lasso": both_sides(
        flow(
            0.5,
            arms("high_side", "hip", left_twist=60, left_elbow=70),
            arms("up", "hip", left_twist=90, left_elbow=90),
            arms("high_front", "hip", left_twist=70, left_elbow=90),
            arms("up", "hip", left_elbow=50),
        )
    ),
    "hips_and_hair": both_sides(
        upper(
            Key(1, arms("hip", head_side=8), sharp=0.6),
            Key(1, arms("back_of_head", "hip", head_side=-12, waist_side=-8, head_bend=-8)),
            Key(2, arms("low_side", "hip", head_twist=25)),
        )
    ),
    "guard_bob": both_sides(flow(1, arms("guard", waist_bend=10, waist_side=12, head_side=6))),
    "dab": both_sides(
        hits(
            2,
            arms("high_side", "across", right_elbow=110, waist_bend=16, chest_bend=12, head_bend=32, head_twist=-35),
            arms("hang"),
            sharp=0.4,
        )
    ),
    "flap": flow(0.5, arms("side", elbow=30), arms("low_side", elbow=40)),
    "pull_rope": both_sides(hits(1, arms("high_front", waist_bend=-6), arms("pull", "belly", waist_twist=12))),
    "look_around": both_sides(hits(1, arms("hip", head_twist=45), arms("hip", head_twist=0, head_bend=12))),
    "long_lines": both_sides(
        flow(2, arms("high_side", "low_side", waist_side=-12, head_twist=25), arms("low_across", waist_bend=14))
    ),
    "frame_slide": both_sides(flow(1, arms("frame", chest_twist=18, head_twist=-20), arms("frame", chest_twist=0))),
    "hanging": flow(1, arms("hang"), arms("hang", elbow=30)),
}
"""Moves of trunk, head and arms by name."""

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
