"""Moves of the feet and hips: grooves, steps, kicks, jumps and turns."""

from synth.motion.choreography.moves import Move, both_sides, concat, feet, lower, mirror, repeat, step

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
