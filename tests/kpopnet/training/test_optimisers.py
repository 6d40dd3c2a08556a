"""Muon makes steps orthogonal, and each optimiser takes its part of the weights."""

import pytest
import torch

from kpopnet.networks import ModelConfig
from kpopnet.networks.network import build_network
from kpopnet.training.optimisers import ITERATIONS, OPTIMISERS, Muon, build_optimisers

MODEL = ModelConfig(crop_px=32, widths=[8, 8, 16, 16])


def plainly_orthogonalised(matrix):
    """The iteration on singular values alone: the singular vectors stay."""
    left, values, right = torch.linalg.svd(matrix, full_matrices=False)
    values = values / matrix.norm()
    for _ in range(ITERATIONS):
        values = 3.4445 * values - 4.7750 * values**3 + 2.0315 * values**5
    return left @ torch.diag(values) @ right


def test_a_step_of_muon_follows_momentum_and_decay():
    weight = torch.nn.Parameter(torch.randn(4, 2, 3, 3, generator=torch.Generator().manual_seed(1)))
    before, optimiser = weight.detach().clone(), Muon([weight], lr=0.1, weight_decay=0.01)
    first, second = (torch.randn(4, 2, 3, 3, generator=torch.Generator().manual_seed(seed)) for seed in (2, 3))
    average, expected = torch.zeros(4, 18), before.flatten(1)
    for gradient in (first, second):
        weight.grad = gradient.clone()
        optimiser.step()
        average = 0.95 * average + 0.05 * gradient.flatten(1)
        ahead = 0.05 * gradient.flatten(1) + 0.95 * average
        expected = expected * (1 - 0.1 * 0.01) - 0.1 * 0.2 * 18**0.5 * plainly_orthogonalised(ahead)
    torch.testing.assert_close(weight.detach().flatten(1), expected, atol=1e-4, rtol=1e-3)


@pytest.mark.parametrize("name", OPTIMISERS)
def test_every_weight_has_one_optimiser_and_only_matrices_decay(name):
    network = build_network(MODEL)
    optimisers = build_optimisers(network, name, 1e-3)
    assert set(optimisers) == {"adamw", name}
    groups = [group for optimiser in optimisers.values() for group in optimiser.param_groups]
    taken = [weight for group in groups for weight in group["params"]]
    assert {id(weight) for weight in taken} == {id(weight) for weight in network.parameters()}
    assert len(taken) == len(list(network.parameters()))
    for group in groups:
        assert {weight.ndim > 1 for weight in group["params"]} == {group["weight_decay"] > 0}


def test_the_layout_of_filters_in_memory_changes_nothing():
    weights = []
    for layout in (torch.contiguous_format, torch.channels_last):
        start, gradient = (torch.randn(4, 2, 3, 3, generator=torch.Generator().manual_seed(seed)) for seed in (1, 2))
        weight = torch.nn.Parameter(start.to(memory_format=layout))
        weight.grad = gradient.to(memory_format=layout)
        Muon([weight], lr=0.1, weight_decay=0.0).step()
        weights.append(weight)
    torch.testing.assert_close(*weights)
