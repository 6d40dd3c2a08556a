"""The networks that come with the package. `NetworkEstimator()` loads the one of joints, a checkpoint without training state.

    model.safetensors              its filters in float16, the rest in float32; all is computed with in float32
    meta.json                      its description, as in every checkpoint (kpopnet.networks)
    finder.safetensors             the finder of people, stored likewise
    graph.onnx, finder_graph.onnx  both for ONNX Runtime, without their filters
    over_time_*.safetensors        joints over time: causal, and with the frames that follow
    MODEL_CARD.md                  how they were trained, how good they are, and where they fail

tools/ship_weights.py writes the folder from a checkpoint of a training.
"""

import hashlib
from pathlib import Path

from kpopnet.errors import InputError

FOLDER = Path(__file__).parent

SHA256: dict[str, str] = {
    "model.safetensors": "fdf7308eade46ddbaf9a194226e9693976e63670327c9c1910f70dfdd0258eb2",
    "meta.json": "6e86fe4100871bb1ce49907d97a0920b42a6f57e3f477347e9c4ff3103a2a61b",
    "graph.onnx": "5d1a350d98b889192607b677ea7a9a9743b29262afd5b857072a6b058624c089",
}
"""Of each file that is loaded, as tools/ship_weights.py wrote it."""

FINDER_SHA256: dict[str, str] = {
    "finder.safetensors": "3bd597f24c9515c14e5285ffcfd843a218fd199ba00dee27b6288cedc967c61c",
    "finder_graph.onnx": "b61b08017b5817832645c3504a597fb83664bc5cb9d2b776fb6d2b3714ddfc2f",
}
"""Of the finder of people (kpopnet.finder), as tools/ship_weights.py wrote it."""

OVER_TIME_SHA256: dict[str, str] = {
    "over_time_causal.safetensors": "d574441d1a9e01dcc69b824c90c7d2911c3d14adc39f5a0d4be2cff62aad25f5",
    "over_time_future.safetensors": "ec1eaecb7341b35524034d4ea02bf0cee35dbef29b3e6bc310d02b51493ab554",
}
"""Of the networks over time (kpopnet.networks.over_time), as tools/ship_weights.py wrote them: the causal one first."""


def shipped_network() -> Path:
    """The folder of the network that comes with the package; raises InputError for files of another version."""
    _check(SHA256)
    return FOLDER


def shipped_finder() -> tuple[Path, Path]:
    """The weights of the finder that comes with the package, and its ONNX file without filters; raises InputError for files of
    another version.
    """
    _check(FINDER_SHA256)
    weights, graph = FINDER_SHA256
    return FOLDER / weights, FOLDER / graph


def shipped_over_time(future: bool) -> Path:
    """The file of a network over time that comes with the package: the causal one, or the one that looks at later frames;
    raises InputError for files of another version.
    """
    _check(OVER_TIME_SHA256)
    return FOLDER / list(OVER_TIME_SHA256)[future]


def _check(digests: dict[str, str]) -> None:
    for name, expected in digests.items():
        file = FOLDER / name
        try:
            found = hashlib.sha256(file.read_bytes()).hexdigest()
        except OSError as error:
            raise InputError(f"{file}: cannot be read ({error.strerror}); install kpopnet again") from error
        if found != expected:
            raise InputError(f"{file}: not the file that came with this version of kpopnet; install kpopnet again")
