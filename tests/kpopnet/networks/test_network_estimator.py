"""The network as an estimator: it gets the crops that it was trained on, and says when it is given a room for a person."""

from dataclasses import asdict

import numpy as np
import pytest
from capsule_people import CAMERA, CapsulePeople
from checkpoints import save_untrained
from factories import draw_room

from kpopnet.camera import CAMERAS
from kpopnet.data.batches import AugmentConfig, CropBatches, EvenOrder, occlude
from kpopnet.networks import ModelConfig
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.ridge import RidgeConfig


@pytest.fixture(scope="module")
def estimator(tmp_path_factory) -> NetworkEstimator:
    return NetworkEstimator(save_untrained(tmp_path_factory.mktemp("run")))


@pytest.mark.parametrize("occluder", [0, 1])
def test_a_training_crop_is_the_crop_that_inference_makes_of_the_same_depth(tmp_path, monkeypatch, occluder):
    """Bit for bit in both channels, occluded or not: no ridge of covered parts shows through."""
    model, people, ridge = ModelConfig(input="depth_ridge", crop_px=32, widths=[8, 8, 8, 8]), CapsulePeople(6), RidgeConfig(0.6)
    estimator = NetworkEstimator(save_untrained(tmp_path, model, config={"ridge": asdict(ridge)}))

    occluded = []
    monkeypatch.setattr("kpopnet.data.batches.occlude", lambda *given: occluded.append(occlude(*given)) or occluded[-1])
    augment = AugmentConfig(mirror=0, rotation_deg=0, scale=0, jitter_m=0, occluder=occluder)
    trained_on = CropBatches(people, model, EvenOrder(6, 6, 6), 0, augment, ridge)[0].crop
    whole = [people.observe(index, 0).depth_m for index in range(6)]
    assert len(occluded) == 6 * occluder
    depth_m = np.stack(occluded or whole)

    seen = []
    predict = estimator.backend
    monkeypatch.setattr(estimator, "backend", lambda crops: seen.extend(crops) or predict(crops))
    estimator.estimate(depth_m, CAMERA)
    np.testing.assert_array_equal(trained_on, np.stack(seen))
    assert trained_on[:, 1].max() > 0.5
    if occluder:
        estimator.estimate(np.stack(whole), CAMERA)
        assert not np.array_equal(trained_on, np.stack(seen[6:]))


def test_a_room_is_reported_once(estimator, caplog):
    camera = CAMERAS["kinect_v1"]
    room_m = np.repeat(draw_room(camera)[None], 3, axis=0)
    for _ in range(2):
        estimator.estimate(room_m, camera)
    (record,) = caplog.records
    assert "shows a whole room" in record.message and "extract_person" in record.message
