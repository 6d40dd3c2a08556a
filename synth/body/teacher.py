"""The body of the virtual teacher, without what simulates its dances."""

import numpy as np

from synth.body.asset import load_body
from synth.body.outfit import load_skin
from synth.body.shape import BodyConfig, Person, draw_person

BODY_SEED = 3


def teacher_person() -> Person:
    return draw_person(np.random.default_rng(BODY_SEED), BodyConfig(), "train")


def teacher_arrays() -> dict[str, np.ndarray]:
    """The teacher's body by the names of the fields of a skin on bones, at rest."""
    asset, skin, person = load_body(), load_skin(), teacher_person()
    return {
        "bone_names": np.array(asset.bone_names),
        "bone_parents": asset.bone_parents,
        "heads_m": person.heads_m.astype(np.float32),
        "t_pose": person.t_pose.astype(np.float32),
        "joints_m": person.joints_m.astype(np.float32),
        "vertices_m": person.vertices_m.astype(np.float32),
        "faces": skin.faces.astype(np.uint16),
        "weight_bones": skin.weight_bones.astype(np.uint8),
        "weights": skin.weights.astype(np.float32),
    }
