"""Every network predicts, learns, and outputs cube coordinates."""

import pytest
import torch

from kpopnet.networks import ModelConfig
from kpopnet.networks.network import build_network

KINDS = ["holistic", "dense"]
SMALL = {"crop_px": 32, "widths": [8, 8, 16, 16]}


def crops(batch=3, channels=1, px=32):
    crop = torch.rand(batch, channels, px, px, generator=torch.Generator().manual_seed(0)) * 2 - 1
    crop[crop > 0.3] = 1
    return crop


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("name", "channels", "px"), [("depth", 1, 32), ("depth_ridge", 2, 48)])
def test_predictions_and_gradients(kind, name, channels, px):
    network = build_network(ModelConfig(kind, name, px, widths=[8, 8, 16, 16]))
    prediction = network(crops(channels=channels, px=px))
    assert prediction.joints.shape == (3, 15, 3)
    assert prediction.joints.dtype == torch.float32
    assert prediction.confidence.shape == (3, 15)
    assert ((prediction.confidence >= 0) & (prediction.confidence <= 1)).all()
    losses = network.loss(prediction, torch.zeros(3, 15, 3))
    assert all(value.ndim == 0 and value >= 0 for value in losses.values())
    sum(losses.values()).backward()
    assert all(weight.grad is not None and weight.grad.isfinite().all() for weight in network.parameters())
    assert all(weight.grad.abs().sum() > 0 for name, weight in network.named_parameters() if weight.ndim > 1)


@pytest.mark.parametrize("kind", KINDS)
def test_the_loss_of_the_confidence_trains_only_the_confidence(kind):
    """Of the last layer, the rows of the confidence; of the encoder and the joints nothing."""
    network = build_network(ModelConfig(kind, **SMALL))
    network.loss(network(crops()), torch.zeros(3, 15, 3))["confidence"].backward()
    last = network.head.maps if kind == "dense" else network.head.layers[-1]
    trained = [name for name, weight in network.named_parameters() if weight.grad is not None and weight.grad.abs().sum() > 0]
    assert trained == [name for name, weight in network.named_parameters() if weight is last.weight or weight is last.bias]
    rows = last.weight.grad.flatten(1).abs().sum(1) > 0
    confidence = torch.arange(60) >= 45 if kind == "dense" else torch.arange(60) % 4 == 3
    assert torch.equal(rows, confidence)


@pytest.mark.parametrize("kind", KINDS)
def test_the_loss_is_the_mean_over_samples(kind):
    """Therefore the mean over processes is the loss of the whole batch."""
    network = build_network(ModelConfig(kind, **SMALL)).eval()
    crop, target = crops(4), torch.rand(4, 15, 3) - 0.5
    whole = network.loss(network(crop), target)
    parts = [network.loss(network(crop[i : i + 2]), target[i : i + 2]) for i in (0, 2)]
    for name, value in whole.items():
        torch.testing.assert_close(value, (parts[0][name] + parts[1][name]) / 2)


def test_the_dense_head_localises_a_peak():
    """All heat in one cell gives the cell's centre, and the depth map's value at the attention's peak."""
    head = build_network(ModelConfig(crop_px=32)).head
    maps = torch.zeros(1, 60, 8, 8)
    maps[0, 4, 2, 6] = 50  # joint 4's heat: row 2, column 6
    maps[0, 15 + 4, 5, 5] = 200  # its attention
    maps[0, 30 + 4, 5, 5] = 0.7  # its depth there
    head.neck, head.maps = torch.nn.Identity(), torch.nn.Conv2d(60, 60, 1)
    with torch.no_grad():
        head.maps.weight.copy_(torch.eye(60)[..., None, None])
        head.maps.bias.zero_()
    prediction = head(maps)
    torch.testing.assert_close(prediction.joints[0, 4], torch.tensor([13 / 8 - 1, 5 / 8 - 1, 0.7]))
    torch.testing.assert_close(prediction.joints[0, 3, :2], torch.zeros(2), atol=1e-6, rtol=0)
