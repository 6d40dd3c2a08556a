"""Makes a checkpoint the network that comes with the package: writes kpopnet/weights/.

    python tools/ship_weights.py outputs/train/RUN/best --set data/small/test

Filters are stored in float16, statistics and biases, which are few and may be large, in float32. The description
loses what tells of the machine that trained. MODEL_CARD.md is written by hand.
Prints the sizes, and how far float16 moves the joints in images of a frozen set. Run from the root of a checkout with
`PYTHONPATH=.`.
"""

import argparse
import hashlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.torch

import kpopnet.weights
from kpopnet.data.shards import ShardedSet
from kpopnet.datasets.synthetic import SyntheticBenchmark, SyntheticConfig
from kpopnet.errors import InputError
from kpopnet.networks import META, portable
from kpopnet.networks.checkpoint import WEIGHTS, load_network
from kpopnet.networks.estimator import NetworkEstimator
from kpopnet.runtime.atomic_write import atomic_path

DIGESTS = re.compile(r"^SHA256: dict\[str, str\] = \{.*?\}$", re.DOTALL | re.MULTILINE)


def ship(checkpoint: Path, folder: Path) -> None:
    """Writes weights, description and digests into a folder that holds an `__init__.py` like that of kpopnet.weights.

    Raises:
        InputError: no checkpoint; weights too large for float16; a description that names a path.
    """
    network, meta = load_network(checkpoint)
    weights = {name: (value.half() if value.ndim > 1 else value).contiguous() for name, value in network.state_dict().items()}
    for name, value in weights.items():
        if value.is_floating_point() and not value.isfinite().all():
            raise InputError(f"{checkpoint}: {name} does not fit into float16")
    meta = portable(meta)
    if paths := [text for text in texts_in(meta) if "/" in text or "\\" in text]:
        raise InputError(f"{checkpoint}: its description holds {paths[0]!r}, which looks like a path")
    digests = {}
    for name, content in (
        (WEIGHTS, safetensors.torch.save(weights)),
        (META, (json.dumps(meta, indent=1) + "\n").encode()),
    ):
        digests[name] = hashlib.sha256(content).hexdigest()
        with atomic_path(folder / name) as part:
            part.write_bytes(content)
    module = folder / "__init__.py"
    rows = "".join(f'    "{name}": "{digest}",\n' for name, digest in digests.items())
    text, found = DIGESTS.subn(f"SHA256: dict[str, str] = {{\n{rows}}}", module.read_text())
    assert found == 1, module
    with atomic_path(module) as part:
        part.write_text(text)


def texts_in(value: Any) -> Iterator[str]:
    """Every text in nested dicts and lists of JSON."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for one in value.values() if isinstance(value, dict) else value:
            yield from texts_in(one)


def changes_mm(one: NetworkEstimator, other: NetworkEstimator, path: Path, images: int) -> np.ndarray:
    """Distances in mm between the joints by two networks, in about so many images of a frozen set."""
    benchmark, changes, seen = SyntheticBenchmark(SyntheticConfig(path=str(path))), [], 0
    for name in benchmark.sequence_names():
        sequence = benchmark.read(name)
        first, second = (network.estimate(sequence.depth_m, sequence.camera).joints_camera_m for network in (one, other))
        distances_mm = 1000 * np.linalg.norm(first - second, axis=-1)
        changes.append(distances_mm[np.isfinite(distances_mm)])
        seen += len(sequence.depth_m)
        if seen >= images:
            break
    return np.concatenate(changes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint", type=Path, help="folder of a trained network")
    parser.add_argument("--set", type=Path, required=True, help="folder of a frozen set, on which the two are compared")
    parser.add_argument("--images", type=int, default=500, help="how many images of it: %(default)s")
    parser.add_argument("--out", type=Path, default=kpopnet.weights.FOLDER, help="the folder to write: %(default)s")
    given = parser.parse_args()
    ShardedSet(given.set)  # refused before anything is written
    ship(given.checkpoint, given.out)
    sizes = {name: (given.out / name).stat().st_size for name in (WEIGHTS, META)}
    print("; ".join(f"{name}: {size:,} bytes" for name, size in sizes.items()))
    networks = NetworkEstimator(given.checkpoint), NetworkEstimator(given.out)
    changed_mm = changes_mm(*networks, given.set, given.images)
    print(f"float16 moves joints by {changed_mm.mean():.2f} mm on average, {changed_mm.max():.2f} mm at most")


if __name__ == "__main__":
    main()
