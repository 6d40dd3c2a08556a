"""The network that comes with the package, a checkpoint without training state: `NetworkEstimator()` loads it.

    model.safetensors    its filters in float16, the rest in float32; all is computed with in float32
    meta.json            its description, as in every checkpoint (kpopnet.networks.description)
    MODEL_CARD.md        how it was trained, how good it is, and where it fails

tools/ship_weights.py writes the folder from a checkpoint of a training.
"""

import hashlib
from pathlib import Path

from kpopnet.errors import InputError

FOLDER = Path(__file__).parent

SHA256: dict[str, str] = {
    "model.safetensors": "e6607f5cbe70983e88f3e166ff5fd81a62bd4d4d22feb18f362d7bd555cf3e6d",
    "meta.json": "4c8c29cc69a273f24f34de577351176b745c1f26fadc02047c3d6bd9bb738ad9",
}
"""Of each file that is loaded, as tools/ship_weights.py wrote it; empty as long as there are none."""


def shipped_network() -> Path:
    """The folder of the network that comes with the package.

    Raises:
        InputError: there is none, or its files are not those that came with this version.
    """
    if not SHA256:
        raise InputError(
            f"{FOLDER}: this checkout holds no weights yet; train a network (python train.py) and name its checkpoint, such as "
            "outputs/train/RUN/best"
        )
    for name, expected in SHA256.items():
        file = FOLDER / name
        try:
            found = hashlib.sha256(file.read_bytes()).hexdigest()
        except OSError as error:
            raise InputError(f"{file}: cannot be read ({error.strerror}); install kpopnet again") from error
        if found != expected:
            raise InputError(f"{file}: not the file that came with this version of kpopnet; install kpopnet again")
    return FOLDER
