"""Moves of the feet and hips: grooves, steps, kicks, jumps and turns."""

from synth.motion.choreography.moves import Key, Move, both_sides, concat, feet, lower, mirror, repeat

WIDE = {"left_foot_x": 0.24, "right_foot_x": 0.24, "left_foot_yaw": 18.0, "right_foot_yaw": 18.0}
HOME: dict[str, float] = {}

_side_step = lower(
    Key(1, feet((0.27, 0), (0.27, 0), hips_x=0.10, drop=0.05), anchor="right"),
    Key(1, {"left_foot_x": 0.10, "right_foot_x": 0.10, "drop": 0.01}, anchor="left"),
)
_march_step = lower(
    Key(0.5, {"left_foot_y": 0.22, "left_foot_z": 0.12, "left_foot_pitch": 25, "hips_x": -0.05, "hips_roll": -3}),
    Key(0.5, {"drop": 0.03}),
)
_front_step = lower(
    Key(1, feet((0.1, 0.17), (0.1, -0.17), drop=0.05, hips_z=0.05, right_foot_pitch=22), anchor="right"),
    Key(1, feet((0.1, 0), (0.1, 0)), anchor="left"),
)
_back_step = lower(
    Key(1, feet((0.1, -0.16), (0.1, 0.16), drop=0.05, hips_z=-0.03), anchor="right"),
    Key(1, feet((0.1, 0), (0.1, 0)), anchor="left"),
)
_front_kick = lower(
    Key(1, feet((0.1, -0.12), (0.1, 0.08), drop=0.06, hips_x=-0.05, left_foot_pitch=25, left_foot_y=0.05)),
    Key(
        1,
        feet((0.06, 0.95), (0.12, 0), left_foot_y=0.66, left_foot_pitch=-25, hips_x=-0.09, hips_z=0.0, hips_pitch=-14),
    ),
    Key(1, feet((0.06, 0.15), (0.12, 0), left_foot_y=0.30, left_foot_pitch=20, hips_x=-0.09, drop=0.03)),
    Key(1, HOME),
)
_high_kick = lower(
    Key(1, feet((0.1, -0.15), (0.1, 0.08), drop=0.08, hips_x=-0.05, left_foot_pitch=25, left_foot_y=0.05)),
    Key(
        1,
        feet((0.05, 0.80), (0.12, 0), left_foot_y=1.22, left_foot_pitch=-55, hips_x=-0.10, hips_z=0.04, hips_pitch=-24),
    ),
    Key(1, feet((0.06, 0.2), (0.12, 0), left_foot_y=0.35, left_foot_pitch=15, hips_x=-0.09, drop=0.03)),
    Key(1, HOME),
)
_side_kick = lower(
    Key(1, feet((0.12, 0.15), (0.1, 0), left_foot_y=0.42, left_foot_pitch=25, hips_x=-0.08, left_knee_out=30)),
    Key(
        1,
        feet((0.86, 0.1), (0.1, 0), left_foot_y=0.66, left_foot_pitch=0, hips_x=-0.10, hips_roll=-24, left_foot_yaw=0),
    ),
    Key(1, feet((0.14, 0.12), (0.1, 0), left_foot_y=0.32, left_foot_pitch=20, hips_x=-0.08, left_knee_out=20)),
    Key(1, HOME),
)
_knee_lift = lower(
    Key(1, feet((0.08, 0.22), (0.12, 0), left_foot_y=0.42, left_foot_pitch=30, hips_x=-0.08, hips_pitch=-4), sharp=0.7),
    Key(1, {"drop": 0.05}),
)

LOWER: dict[str, Move] = {
    "bounce": lower(Key(0.5, {"drop": 0.06}), Key(0.5, {"drop": 0.01})),
    "sway": both_sides(lower(Key(1, {"hips_x": 0.08, "hips_roll": 9, "drop": 0.03, "right_knee_out": 6}))),
    "hip_bumps": concat(
        lower(Key(0.5, WIDE | {"hips_x": 0.10, "hips_roll": 11, "drop": 0.05}), Key(0.5, WIDE | {"drop": 0.06})),
        lower(Key(0.5, WIDE | {"hips_x": 0.10, "hips_roll": 11, "drop": 0.05}), Key(0.5, {"drop": 0.04})),
    ),
    "hip_circle": lower(
        *(
            Key(1, WIDE | {"hips_x": x, "hips_z": z, "drop": 0.07, "hips_pitch": 120 * z, "hips_roll": 90 * x})
            for x, z in ((0.09, 0.0), (0.0, 0.09), (-0.09, 0.0))
        ),
        Key(1, HOME | {"drop": 0.03}),
    ),
    "twist_hips": both_sides(lower(Key(0.5, {"hips_yaw": 24, "drop": 0.07, "left_foot_yaw": -4}), Key(0.5, {"drop": 0.03}))),
    "side_steps": both_sides(_side_step),
    "double_side_steps": both_sides(repeat(_side_step, 2)),
    "march": both_sides(_march_step),
    "walk_and_back": concat(_front_step, mirror(_front_step), _back_step, mirror(_back_step)),
    "taps_out": both_sides(
        lower(
            Key(1, feet((0.36, 0.05), (0.10, 0), hips_x=-0.06, drop=0.05, left_foot_pitch=15, hips_roll=-5)),
            Key(1, {"drop": 0.02}),
        )
    ),
    "taps_front": both_sides(
        lower(
            Key(1, feet((0.08, 0.32), (0.12, 0), hips_x=-0.04, drop=0.06, left_foot_pitch=-18)),
            Key(1, {"drop": 0.02}),
        )
    ),
    "grapevine": both_sides(
        lower(
            Key(1, feet((0.25, 0), (0.25, 0), drop=0.05, hips_x=0.06), anchor="right"),
            Key(1, feet((0.13, 0.11), (-0.13, -0.11), drop=0.06, hips_yaw=-12), anchor="left"),
            Key(1, feet((0.25, 0), (0.25, 0), drop=0.05, hips_x=0.06), anchor="right"),
            Key(1, {"drop": 0.02}, anchor="left"),
        )
    ),
    "squats": lower(
        Key(1, WIDE | {"drop": 0.30, "hips_z": -0.14, "hips_pitch": 24}, sharp=0.8),
        Key(1, WIDE | {"drop": 0.04}),
        Key(1, WIDE | {"drop": 0.34, "hips_z": -0.15, "hips_pitch": 26}, sharp=0.8),
        Key(1, {"drop": 0.02}),
    ),
    "drop_low": lower(
        Key(
            2,
            {
                "drop": 0.52,
                "hips_z": -0.16,
                "hips_pitch": 20,
                "left_foot_x": 0.2,
                "right_foot_x": 0.2,
                "left_knee_out": 18,
                "right_knee_out": 18,
                "left_foot_yaw": 22,
                "right_foot_yaw": 22,
            },
        ),
        Key(2, {"drop": 0.02}),
    ),
    "lunges": both_sides(
        lower(
            Key(
                1,
                feet((0.50, 0.06), (0.16, 0), hips_x=0.22, drop=0.22, hips_pitch=8, left_foot_yaw=30, left_knee_out=10),
            ),
            Key(1, {"drop": 0.03}),
        )
    ),
    "front_lunge": both_sides(
        lower(
            Key(1, feet((0.1, 0.42), (0.12, -0.12), drop=0.25, hips_z=0.14, right_foot_pitch=38)),
            Key(1, {"drop": 0.03}),
        )
    ),
    "front_kicks": both_sides(_front_kick),
    "high_kicks": both_sides(_high_kick),
    "side_kicks": both_sides(_side_kick),
    "knee_lifts": both_sides(_knee_lift),
    "hops": lower(
        Key(0.5, {"drop": 0.12, "hips_pitch": 8}),
        Key(0.5, {"air": 0.13, "left_foot_pitch": 30, "right_foot_pitch": 30}),
        Key(0.5, {"drop": 0.12, "hips_pitch": 6}),
        Key(0.5, {"drop": 0.01}),
    ),
    "jump_apart": lower(
        Key(0.5, {"drop": 0.14, "hips_pitch": 10}),
        Key(0.5, WIDE | {"air": 0.15, "left_foot_pitch": 25, "right_foot_pitch": 25}),
        Key(1, WIDE | {"drop": 0.14, "hips_pitch": 8}),
        Key(0.5, {"air": 0.10, "left_foot_pitch": 20, "right_foot_pitch": 20}),
        Key(0.5, {"drop": 0.09}),
        Key(1, {"drop": 0.01}),
    ),
    "step_turn": lower(
        *(
            Key(1, {"drop": drop, "left_foot_x": 0.11, "right_foot_x": 0.11}, turn=90, anchor=anchor)
            for drop, anchor in ((0.04, "left"), (0.02, "right"), (0.04, "left"), (0.01, "right"))
        )
    ),
    "spin": lower(
        Key(1, {"drop": 0.08, "hips_yaw": -20, "right_foot_x": 0.2}),
        *(
            Key(
                0.5,
                feet((0.08, 0), (0.06, 0.10), hips_x=0.06, right_foot_y=0.13, right_foot_pitch=30),
                turn=90,
                anchor="left",
            )
            for _ in range(4)
        ),
        Key(1, {"drop": 0.07}),
    ),
    "pivot_half_turns": lower(
        Key(1, feet((0.1, 0.16), (0.1, -0.16), drop=0.05), anchor="right"),
        Key(1, feet((0.1, -0.16), (0.1, 0.16), drop=0.05), turn=-180, anchor="left"),
        Key(1, feet((0.1, 0.16), (0.1, -0.16), drop=0.05), anchor="right"),
        Key(1, HOME, turn=-180, anchor="left"),
    ),
}
"""Moves of the feet and hips by name. Each starts and ends in the HOME shape, so that any two can be concatenated."""
