"""The body of the virtual teacher."""

import numpy as np

from synth.body.asset import load_body
from synth.body.outfit import load_skin
from synth.body.teacher import teacher_arrays, teacher_person


def test_its_clothes_lie_close_and_it_stands_on_the_soles_that_the_dances_were_made_for():
    person, shown_m = teacher_person(), teacher_arrays()["vertices_m"]
    assert shown_m[:, 2].min() == person.vertices_m[:, 2].min()
    asset, skin = load_body(), load_skin()
    arms = [asset.bone(f"{side}{part}") for side in ("Left", "Right") for part in ("Arm", "ForeArm")]
    heaviest = np.take_along_axis(skin.weight_bones, skin.weights.argmax(axis=1)[:, None], axis=1)[: len(person.bare_m), 0]
    on_arms = np.isin(heaviest, arms)
    assert np.linalg.norm(shown_m[: len(person.bare_m)] - person.bare_m, axis=1)[on_arms].max() < 0.04
