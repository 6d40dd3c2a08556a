"""What runs a network: torch, or ONNX Runtime, found by what the network is stored as. ONNX files need no torch, and on a CPU
take half of the time for one crop; the networks that come with the package are stored for both, for ONNX Runtime with coarser
levels that compute in 8 bits, which halves the time again where a processor has VNNI.
"""

from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from safetensors.numpy import load_file

from kpopnet.data.cube import INPUTS
from kpopnet.errors import InputError
from kpopnet.networks import WEIGHTS, ModelConfig, check_description, read_meta
from kpopnet.runtime.input_files import as_path, expect, names_in, parse_json, read_with
from kpopnet.runtime.provenance import optional_library
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.weights import shipped

ONNX_SUFFIX = ".onnx"
"""Of the files of `kpopnet export`; another path is a checkpoint's folder."""

KEY, ONNX_FORMAT = "kpopnet", "kpopnet-onnx"
"""The metadata entry of an ONNX file that holds its description (kpopnet.networks), and its format."""

INPUT, OUTPUTS, PERSON_LOGIT = "crops", ("joints", "confidence"), "person_logit"

GRAPH = "graph.onnx"
"""Of the network that comes with the package: an ONNX file without its filters."""

NORMALISED, NORM, EPSILON = "0.weight", "1.", 1e-5
"""Of a convolution and the batch normalisation that follows it (kpopnet.networks.network.convolution): the end of the name of
its filters, the beginning of that of the statistics, and torch's summand of the variance."""


Output = tuple[np.ndarray, np.ndarray, np.ndarray | None]
"""Of a `Backend`: joints, confidence and logits."""


class Backend(Protocol):
    """Runs a network; `meta` is its checked description (kpopnet.networks)."""

    meta: dict

    def __call__(self, crops: np.ndarray) -> Output:
        """From (N, C, S, S) float32 crops (kpopnet.data.cube.crop): (N, 15, 3) joints in cube units, (N, 15) confidence, and
        the (N,) logit of the probability that they show a person, None where it does not judge.
        """
        ...


def open_network(checkpoint: Path | str | None, device: str = "cpu") -> Backend:
    """Opens a checkpoint's folder, a file of `kpopnet export`, or None for the network that comes with the package.

    Raises InputError: no network there, a damaged one, or no such device.
    """
    place = _place(checkpoint)
    if checkpoint is None and device == "cpu":
        return OnnxBackend(place / GRAPH, filters(place / WEIGHTS))
    if place.suffix == ONNX_SUFFIX:
        if device != "cpu":
            raise InputError(f"device={device}: ONNX files run on the cpu")
        return OnnxBackend(place)
    from kpopnet.networks.checkpoint import TorchBackend  # takes a second to import

    return TorchBackend(place, device)


def read_description(checkpoint: Path | str | None) -> dict:
    """The description of a network; arguments and errors as in `open_network`."""
    place = _place(checkpoint)
    return OnnxBackend(place).meta if place.suffix == ONNX_SUFFIX else read_meta(place)


def _place(checkpoint: Path | str | None) -> Path:
    return shipped("joints")[0].parent if checkpoint is None else as_path(checkpoint)


def shipped_session(network: str) -> Any:
    """`onnx_session` of a network that comes with the package; raises InputError if it is missing."""
    weights, graph = shipped(network)
    return onnx_session(graph, graph.read_bytes(), filters(weights))


def filters(weights: Path) -> dict[str, np.ndarray]:
    """The filters of a checkpoint by their names in its ONNX file, each with the batch normalisation that follows it."""
    stored, merged = {name: value.astype(np.float32) for name, value in load_file(weights).items()}, {}
    for name, value in stored.items():
        norm = name.removesuffix(NORMALISED) + NORM
        if name.endswith(NORMALISED) and norm + "running_var" in stored:
            scale = stored[norm + "weight"] / np.sqrt(stored[norm + "running_var"] + np.float32(EPSILON))
            merged[f"network.{name}"] = value * scale[:, None, None, None]
    return merged


class OnnxBackend:
    """A file of `kpopnet export`, run by ONNX Runtime on the CPU; it can be pickled for worker processes.

    It computes on one thread: for several sequences there are several processes. ONNX Runtime itself refuses weights in files
    outside the working folder.
    """

    def __init__(self, path: Path | str, filters: dict[str, np.ndarray] | None = None) -> None:
        """Opens a file, whose `filters`, if any are given, are not in it but these.

        Raises InputError: missing, damaged, or another network; ONNX Runtime cannot run it, or is not installed.
        """
        self.path, self.filters = Path(path), filters or {}
        self.content: bytes = read_with(Path.read_bytes, self.path, "cannot be read")
        session = self._session
        described = session.get_modelmeta().custom_metadata_map.get(KEY)
        if described is None:
            raise InputError(f"{path}: not a network of kpopnet export (its metadata has no entry {KEY})")
        self.meta = check_description(str(path), parse_json(described, f"{path}: metadata", non_finite=True), ONNX_FORMAT)
        model = ModelConfig(**self.meta["model"])
        size = INPUTS[model.input], model.crop_px, model.crop_px
        wanted = {INPUT: size, OUTPUTS[0]: (NUM_JOINTS, 3), OUTPUTS[1]: (NUM_JOINTS,)}
        found = {one.name: tuple(one.shape[1:]) for one in (*session.get_inputs(), *session.get_outputs())}
        self.outputs = list(OUTPUTS)
        if found.get(PERSON_LOGIT) == ():
            self.outputs.append(PERSON_LOGIT)
            del found[PERSON_LOGIT]
        expect(found == wanted, str(path), f"values of the shapes {wanted} for each crop, found {found}")
        types = {one.type for one in (*session.get_inputs(), *session.get_outputs())}
        expect(types == {"tensor(float)"}, str(path), f"float32 values, found {names_in(types)}")
        read_with(lambda _: self(np.zeros((1, *size), np.float32)), self.path, "ONNX Runtime cannot run it")

    def __call__(self, crops: np.ndarray) -> Output:
        """See `Backend`."""
        joints, confidence, *person = self._session.run(self.outputs, {INPUT: crops})
        return joints, confidence, person[0] if person else None

    def __getstate__(self) -> dict:
        return {name: getattr(self, name) for name in ("path", "filters", "content", "meta", "outputs")}

    @cached_property
    def _session(self) -> Any:
        return onnx_session(self.path, self.content, self.filters)


def onnx_session(path: Path, content: bytes, filters: dict[str, np.ndarray]) -> Any:
    """ONNX Runtime for the content of a file, on one thread of the CPU, with the `filters` that are not in it.

    Raises InputError: damaged; ONNX Runtime is not installed.
    """
    with optional_library(str(path), "onnxruntime", "onnx"):
        import onnxruntime  # takes a tenth of a second to import
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3  # errors, which are raised too
    if filters:
        values = [onnxruntime.OrtValue.ortvalue_from_numpy(value) for value in filters.values()]
        options.add_external_initializers(list(filters), values)
    return read_with(
        lambda _: onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"]),
        path,
        "not an ONNX file, or a damaged one",
    )
