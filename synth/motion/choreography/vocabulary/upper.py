"""Moves of trunk, head and arms."""

from synth.motion.choreography.moves import Key, Move, arms, both_sides, flow, hits, upper

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
