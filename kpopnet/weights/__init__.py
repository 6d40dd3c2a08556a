"""The networks that come with the package. `NetworkEstimator()` loads the one of joints, a checkpoint without training state.

    model.safetensors              its filters in float16, the rest in float32; all is computed with in float32
    meta.json                      its description, as in every checkpoint (kpopnet.networks)
    finder.onnx                    the finder of people
    over_time_*.safetensors        joints over time: causal, and with the frames that follow
    MODEL_CARD.md                  how they were trained, how good they are, and where they fail

tools/ship_weights.py writes the folder from a checkpoint of a training.
"""

import hashlib
from pathlib import Path

from kpopnet.errors import InputError

FOLDER = Path(__file__).parent

SHA256: dict[str, str] = {
    "model.safetensors": "ec9057252f8b867a9e7d6b2f3c61f642015564e2b6dbc879edfca928f3d87edc",
    "meta.json": "ad67a510a56c5129c4ea8b95ae5bc8c0eab404c6a39f26b61b2e7cc09f199ab3",
    "graph.onnx": "ad133afc810bda86dd507c5c9e90f42d03c5c34e4c7d8f37f9a26e062c75a6d1",
}
"""Of each file that is loaded, as tools/ship_weights.py wrote it."""

FINDER_SHA256: dict[str, str] = {
    "finder.onnx": "4c707cc9731f3e8edb8105e4f3ab1f7de2f5944d1f5ba66cfa507f5f5a93f94c",
}
"""Of the finder of people (kpopnet.finder), as tools/ship_weights.py wrote it."""

OVER_TIME_SHA256: dict[str, str] = {
    "over_time_causal.safetensors": "382af8c42269a5529425b6808d746ea48c14c187f463d9bb5de95ee4af7f6c37",
    "over_time_future.safetensors": "1c1d0d08d4c26bb19bd59bf199a89dc27247dad012099a3b5b7025e1e704e268",
}
"""Of the networks over time (kpopnet.networks.over_time), as tools/ship_weights.py wrote them: the causal one first."""


def shipped_network() -> Path:
    """The folder of the network that comes with the package; raises InputError for files of another version."""
    _check(SHA256)
    return FOLDER


def shipped_finder() -> Path:
    """The file of the finder that comes with the package; raises InputError for one of another version."""
    _check(FINDER_SHA256)
    return FOLDER / next(iter(FINDER_SHA256))


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
