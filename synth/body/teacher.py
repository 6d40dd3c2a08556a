"""The body of the virtual teacher, without what simulates its dances."""

import numpy as np

from synth.body.asset import load_body
from synth.body.outfit import ClothesConfig, load_skin
from synth.body.shape import BodyConfig, Person, draw_person, dress

BODY_SEED, OUTFIT_SEED = 3, 10
OUTFIT = ClothesConfig(dressed=1, skirt=0, coat=0, haired=1, hat=0, backpack=0, bag=0)


def teacher_person() -> Person:
    return draw_person(np.random.default_rng(BODY_SEED), BodyConfig(), "train")


def teacher_arrays() -> dict[str, np.ndarray]:
    """The teacher's body by the names of the fields of a skin on bones, at rest, in clothes that lie close, so that one sees
    what the limbs do. The shoes are those of `teacher_person`, on whose soles the dances stand.
    """
    asset, skin, person = load_body(), load_skin(), teacher_person()
    dressed = dress(person, female=False, rng=np.random.default_rng(OUTFIT_SEED), config=OUTFIT)
    feet = [number for number, name in enumerate(asset.bone_names) if "Foot" in name or "Toe" in name]
    heaviest = np.take_along_axis(skin.weight_bones, skin.weights.argmax(axis=1)[:, None], axis=1)
    vertices_m = np.where(np.isin(heaviest, feet), person.vertices_m, dressed.vertices_m)
    return {
        "bone_names": np.array(asset.bone_names),
        "bone_parents": asset.bone_parents,
        "heads_m": person.heads_m.astype(np.float32),
        "t_pose": person.t_pose.astype(np.float32),
        "joints_m": person.joints_m.astype(np.float32),
        "vertices_m": vertices_m.astype(np.float32),
        "faces": skin.faces.astype(np.uint16),
        "weight_bones": skin.weight_bones.astype(np.uint8),
        "weights": skin.weights.astype(np.float32),
    }
