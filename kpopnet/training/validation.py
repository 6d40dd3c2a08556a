"""Validation during training: errors on people outside the training set, and images of the estimates."""

import numpy as np
import torch

from kpopnet.data.batches import Batch
from kpopnet.data.cube import Cube
from kpopnet.networks.network import CONFIDENT_WITHIN_M, PoseNetwork
from kpopnet.viz.drawing import ESTIMATED, TRUE, enlarged, probability_rgb, scene_tile, sheet

MAX_SAMPLES = 12


@torch.inference_mode()
def validate(network: PoseNetwork, batches: list[Batch], device: torch.device) -> tuple[dict[str, float], np.ndarray]:
    """Measures the errors of a network, which is on this device, on validation crops.

    mean_error_cm over all joints of all samples, within_10cm (the share of joints with an error below 10 cm), and
    mean_confidence (which should equal that share); and the (N, 15, 3) estimates in cube units.
    """
    network.eval()
    estimates, errors_m, confidences = [], [], []
    for batch in batches:
        prediction = network(batch.crop.to(device))
        estimates.append(prediction.joints.cpu().numpy())
        confidences.append(prediction.confidence.cpu().numpy())
        for estimate, target, (*centre_m, half_size_m) in zip(
            estimates[-1], batch.target.numpy(), batch.cube_m.numpy(), strict=True
        ):
            cube = Cube(np.array(centre_m), half_size_m)
            errors_m.append(np.linalg.norm(cube.to_metres(estimate) - cube.to_metres(target), axis=-1))
    errors = np.stack(errors_m)
    metrics = {
        "mean_error_cm": 100 * float(errors.mean()),
        "within_10cm": float((errors < CONFIDENT_WITHIN_M).mean()),
        "mean_confidence": float(np.concatenate(confidences).mean()),
    }
    return metrics, np.concatenate(estimates)


def validation_sheet(batches: list[Batch], estimates: np.ndarray) -> np.ndarray:
    """Draws evenly spaced validation crops with their ground-truth and estimated skeletons, RGB."""
    crops, targets, cubes = (np.concatenate([batch[field] for batch in batches]) for field in range(3))
    tiles = []
    for row in np.linspace(0, len(crops) - 1, min(MAX_SAMPLES, len(crops))).astype(int):
        *centre_m, half_size_m = cubes[row].tolist()
        cube = Cube(np.array(centre_m), half_size_m)
        d = crops[row, 0]
        depth_m = np.where(d < 1, d * cube.half_size_m + cube.centre_m[2], 0)
        skeletons = (cube.to_metres(targets[row]), TRUE), (cube.to_metres(estimates[row]), ESTIMATED)
        tiles.append(scene_tile(depth_m, cube.camera(len(d)), skeletons, 288))
        tiles += [enlarged(probability_rgb(ridge), 288) for ridge in crops[row, 1:]]
    return sheet([("", tiles[i : i + 4]) for i in range(0, len(tiles), 4)], styles=(TRUE, ESTIMATED))
