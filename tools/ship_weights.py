"""Makes a checkpoint the network that comes with the package, a finder its finder of people, a mask network that of the finder,
two networks over time those of its modes, or a network that lifts joints that of a webcam: writes kpopnet/weights/.

    python tools/ship_weights.py outputs/train/RUN/best --set data/small/train
    python tools/ship_weights.py outputs/finder/RUN/finder.safetensors --set data/room_images/train
    python tools/ship_weights.py --masks outputs/finder/RUN/finder.safetensors --set data/person_masks/train
    python tools/ship_weights.py data/over_time/causal.safetensors --future data/over_time/future.safetensors
    python tools/ship_weights.py --lifting data/lifting.safetensors

Filters are stored in float16, statistics and biases, which are few and may be large, in float32. The description
loses what tells of the machine that trained. MODEL_CARD.md is written by hand. For ONNX Runtime levels compute in 8 bits
(tools/eight_bits.py), whose ranges are those of some hundred images of --set, a set that the network was trained on.
Prints the sizes, and how far float16, and 8 bits, move the joints there. Run from the root of a checkout with `PYTHONPATH=.`.
"""

import argparse
import hashlib
import json
import math
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.torch
import torch

import kpopnet.weights
from kpopnet.camera import MM_PER_METRE
from kpopnet.data.batches import CropBatches, EvenOrder
from kpopnet.data.person_masks import OTHER, OWN, read_person_masks
from kpopnet.data.room_images import RoomImages
from kpopnet.data.shards import ShardedSet
from kpopnet.errors import InputError
from kpopnet.finder import masks, people
from kpopnet.finder.network import CellsNetwork, FinderNetwork, MaskNetwork, export_finder
from kpopnet.finder.network import load_network as load_finder
from kpopnet.networks import META, PERSON, WEIGHTS, ModelConfig, portable
from kpopnet.networks.backend import GRAPH, INPUT, Backend, OnnxBackend, filters, open_network
from kpopnet.networks.checkpoint import load_network
from kpopnet.networks.lifting import Lifting
from kpopnet.networks.onnx_export import export_network
from kpopnet.networks.over_time import OverTime
from kpopnet.runtime.atomic_write import write_whole
from kpopnet.runtime.endings import user_errors
from synth.samples.observe import ExtractionConfig, Observer
from synth.sensor.model import SensorConfig
from tools.eight_bits import COARSER, FINDER, in_eight_bits

IMAGES, BATCH = 512, 32
"""How many inputs tell the ranges, in calls of how many."""

Inputs = list[dict[str, np.ndarray]]
"""Of the calls of a network by ONNX Runtime, by name."""


def ship(checkpoint: Path, folder: Path, inputs: Inputs) -> None:
    """Writes weights, description and digests into a folder that holds an `__init__.py` like that of kpopnet.weights.

    The `inputs` are crops that the network is likely to be given. Raises InputError: no checkpoint; weights too large for
    float16; a description that names a path.
    """
    network, meta = load_network(checkpoint)
    meta = portable(meta)
    if paths := [text for text in texts_in(meta) if "/" in text or "\\" in text]:
        raise InputError(f"{checkpoint}: its description holds {paths[0]!r}, which looks like a path")
    described = (json.dumps(meta, indent=1) + "\n").encode()
    person, network.person = network.person, None
    files = {WEIGHTS: _halved(network, checkpoint), META: described}
    if person is not None:
        files[PERSON] = _halved(person, checkpoint)
    with tempfile.TemporaryDirectory() as place:
        for name, content in files.items():
            (Path(place) / name).write_bytes(content)
        whole = Path(place) / GRAPH
        export_network(*load_network(place), whole)  # with the biases of filters in float16
        files[GRAPH] = without_filters(in_eight_bits(whole.read_bytes(), inputs), Path(place) / WEIGHTS)
    _write(folder, "joints", files)
    if person is None:
        (folder / PERSON).unlink(missing_ok=True)  # of the network of before: it would be loaded with this one


def without_filters(content: bytes, weights: Path) -> bytes:
    """An ONNX file without those of its tensors that are made of a file of weights, all of which must be there."""
    import onnx

    model, names = onnx.load_from_string(content), set(filters(weights))
    assert names <= {tensor.name for tensor in model.graph.initializer}, names
    for tensor in model.graph.initializer:
        if tensor.name in names:
            tensor.ClearField("raw_data")
            tensor.data_location = onnx.TensorProto.EXTERNAL
            tensor.external_data.add(key="location", value=weights.name)
    return model.SerializeToString()


def ship_finder(weights: Path, folder: Path, network: str, kind: type[CellsNetwork], inputs: Inputs) -> None:
    """Writes a network of the finder, and its digests, into such a folder, `inputs` as above; raises InputError for damaged
    weights.
    """
    name, graph = kpopnet.weights.SHA256[network]
    files = {name: _halved(load_finder(weights, kind), weights)}
    with tempfile.TemporaryDirectory() as place:
        stored = Path(place) / name
        stored.write_bytes(files[name])
        exported, begins = export_finder(load_finder(stored, kind)), FINDER if kind is FinderNetwork else COARSER
        files[graph] = without_filters(in_eight_bits(exported, inputs, begins), stored)
    _write(folder, network, files)
    print("; ".join(f"{name}: {(folder / name).stat().st_size:,} bytes" for name in files))


def ship_over_time(causal: Path, future: Path, folder: Path) -> None:
    """Writes both networks over time, as tools/over_time.py made them; raises InputError if one is of the other form."""
    for path, expected in ((causal, False), (future, True)):
        if OverTime.load(path).future is not expected:
            raise InputError(f"{path}: expected a network that {'looks at' if expected else 'does not know'} later frames")
    names = kpopnet.weights.SHA256["over_time"]
    _write(folder, "over_time", dict(zip(names, (causal.read_bytes(), future.read_bytes()), strict=True)))


def ship_lifting(weights: Path, folder: Path) -> None:
    """Writes a network that lifts joints, as tools/fit_lifting.py made it; raises InputError for another file."""
    Lifting.load(weights)
    _write(folder, "lifting", {"lifting.safetensors": weights.read_bytes()})


def _halved(network: torch.nn.Module, source: Path) -> bytes:
    """The weights as a file, filters in float16."""
    weights = {name: (value.half() if value.ndim > 1 else value).contiguous() for name, value in network.state_dict().items()}
    for name, value in weights.items():
        if value.is_floating_point() and not value.isfinite().all():
            raise InputError(f"{source}: {name} does not fit into float16")
    return safetensors.torch.save(weights)


def _write(folder: Path, network: str, files: dict[str, bytes]) -> None:
    """Writes the files of a network, and their digests into the folder's module; raises InputError for a folder without one."""
    module = folder / "__init__.py"
    if not module.is_file():
        raise InputError(f"{folder}: no {module.name} to hold the digests; copy kpopnet/weights there")
    for name, content in files.items():
        write_whole(folder / name, content)
    rows = "".join(f'        "{name}": "{hashlib.sha256(content).hexdigest()}",\n' for name, content in files.items())
    pattern = re.compile(rf'(^    "{network}": {{\n).*?(^    }},$)', re.DOTALL | re.MULTILINE)
    text, found = pattern.subn(rf"\1{rows}\2", module.read_text())
    assert found == 1, module
    write_whole(module, text)


def texts_in(value: Any) -> Iterator[str]:
    """Every text in nested dicts and lists of JSON."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for one in value.values() if isinstance(value, dict) else value:
            yield from texts_in(one)


def crops_of(path: Path, model: ModelConfig) -> Inputs:
    """Of the network of joints: crops of images of a folder of shards."""
    source = Observer(ShardedSet(path), SensorConfig(), ExtractionConfig(), 0)
    count = min(IMAGES, len(source))
    batches = CropBatches(source, model, EvenOrder(len(source), BATCH, count), 0, None)
    return [{INPUT: np.asarray(batches[step].crop)} for step in range(math.ceil(count / BATCH))]


def images_of(path: Path) -> Inputs:
    """Of the finder: the first of a folder's room images."""
    stored = RoomImages(path).file(0)
    images_m, cameras = (stored["depth_mm"] / MM_PER_METRE).astype(np.float32), stored["cameras"].astype(np.float32)
    rows = range(min(IMAGES, len(images_m)))
    return [dict(zip(people.INPUTS, (images_m[row : row + 1], cameras[row : row + 1, :4]), strict=True)) for row in rows]


def masks_of(path: Path) -> Inputs:
    """Of the mask network: some of a folder's person masks."""
    depth_mm, labels, centres_m, _ = read_person_masks(path)
    count = min(IMAGES, len(depth_mm))
    rows = np.arange(count) * len(depth_mm) // count
    crops = (depth_mm[rows] / MM_PER_METRE).astype(np.float32), labels[rows] & (OWN | OTHER), centres_m[rows]
    parts = [[one[first : first + BATCH] for one in crops] for first in range(0, count, BATCH)]
    return [dict(zip(masks.INPUTS, part, strict=True)) for part in parts]


def changes_mm(one: Backend, other: Backend, inputs: Inputs, half_size_m: float) -> np.ndarray:
    """Distances in mm between the joints by two networks, in crops of cubes of that half size, perspective aside."""
    moved = [np.linalg.norm(one(crops[INPUT])[0] - other(crops[INPUT])[0], axis=-1) for crops in inputs]
    return 1000 * half_size_m * np.concatenate(moved)


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint", type=Path, nargs="?", help="folder of a trained network, or a .safetensors file")
    parser.add_argument("--future", type=Path, help="the other network over time, which looks at later frames")
    parser.add_argument("--lifting", type=Path, help="a network that lifts joints, as tools/fit_lifting.py made it")
    parser.add_argument("--masks", type=Path, help="a finder's mask network: finder.safetensors of training.part=masks")
    parser.add_argument("--set", type=Path, help="folder of what it was trained on: shards, room images or person masks")
    parser.add_argument(
        "--out", type=Path, default=kpopnet.weights.FOLDER, help="the folder to write, a copy of %(default)s or that one"
    )
    given = parser.parse_args()
    if sum(one is not None for one in (given.checkpoint, given.lifting, given.masks)) != 1:
        parser.error("give a checkpoint, --lifting or --masks")
    if given.future is not None and given.checkpoint is None:
        parser.error("--future needs the causal network over time as checkpoint")
    if given.lifting is not None:
        ship_lifting(given.lifting, given.out)
        return
    if given.future is not None:
        ship_over_time(given.checkpoint, given.future, given.out)
        return
    if given.set is None:
        parser.error("a network needs --set")
    if given.masks is not None:
        ship_finder(given.masks, given.out, "masks", MaskNetwork, masks_of(given.set))
        return
    if given.checkpoint.suffix == ".safetensors":
        ship_finder(given.checkpoint, given.out, "finder", FinderNetwork, images_of(given.set))
        return
    trained = open_network(given.checkpoint)
    model = ModelConfig(**trained.meta["model"])
    inputs = crops_of(given.set, model)
    ship(given.checkpoint, given.out, inputs)
    sizes = {path.name: path.stat().st_size for path in map(given.out.joinpath, (WEIGHTS, META, PERSON)) if path.is_file()}
    print("; ".join(f"{name}: {size:,} bytes" for name, size in sizes.items()))
    rounded = OnnxBackend(given.out / GRAPH, filters(given.out / WEIGHTS))
    for name, network in (("float16 moves", open_network(given.out)), ("float16 and 8 bits move", rounded)):
        changed_mm = changes_mm(trained, network, inputs, model.half_size_m)
        print(f"{name} joints by {changed_mm.mean():.2f} mm on average, {changed_mm.max():.2f} mm at most")


if __name__ == "__main__":
    main()
