"""The networks that come with the package. `NetworkEstimator()` loads the one of joints, a checkpoint without training state.

    model.safetensors              its filters in float16, the rest in float32; all is computed with in float32
    meta.json                      its description, as in every checkpoint (kpopnet.networks)
    person.safetensors             its head that judges whether a crop shows a person
    finder.safetensors             the finder of people, stored likewise
    masks.safetensors              its mask network, which says which pixels are theirs, stored likewise
    *graph.onnx                    these three for ONNX Runtime, without their filters
    over_time_*.safetensors        joints over time: causal, and with the frames that follow
    lifting.safetensors            joints of a webcam's points (kpopnet.networks.lifting)
    MODEL_CARD.md                  how they were trained, how good they are, and where they fail

tools/ship_weights.py writes the folder from a checkpoint of a training.
"""

import hashlib
from pathlib import Path

from kpopnet.errors import InputError

FOLDER = Path(__file__).parent

SHA256: dict[str, dict[str, str]] = {
    "joints": {
        "model.safetensors": "ee381b09e16c37197023ffa8f4d97c9786d88d51df83f161bb2c935e69fda04e",
        "meta.json": "b1e8d80966729fcedfbeb9f239c0021b0be0e2226e8811b4c24060c78641a1be",
        "person.safetensors": "a55cd8803082a113a0e21259759d65def759426ad04e148382bc85434835636f",
        "graph.onnx": "ec20b7786ab19ccb4d95507986c5104f7935a9b051ba1e0bad93679f15153197",
    },
    "finder": {
        "finder.safetensors": "55314707dd7e2e31d185173ca28dcf94dc1a4ec2332f9e9c460e161d9afc55eb",
        "finder_graph.onnx": "344c9ef1ed9178614f2f9555db911d662a26f518964d3806c94f9bad1aa8266c",
    },
    "masks": {
        "masks.safetensors": "b53536402cc7f27da10d08cb721b88ce2395e100190141a899164e38fa3941b3",
        "masks_graph.onnx": "5eb6d993ee7c60c2a0fff2f7cb59da0fdcb3d13fb79f4a3c8893f1cb658cfa79",
    },
    "over_time": {
        "over_time_causal.safetensors": "d574441d1a9e01dcc69b824c90c7d2911c3d14adc39f5a0d4be2cff62aad25f5",
        "over_time_future.safetensors": "ec1eaecb7341b35524034d4ea02bf0cee35dbef29b3e6bc310d02b51493ab554",
    },
    "lifting": {
        "lifting.safetensors": "ef34f4f56a118bfb550c02e7ce9db32579dddccc146057467271622950ad81bc",
    },
}
"""Of each file that is loaded, by network, as tools/ship_weights.py wrote it."""


def shipped(network: str) -> list[Path]:
    """The files of a network in `SHA256`, in their order there; raises InputError for files of another version."""
    for name, expected in SHA256[network].items():
        file = FOLDER / name
        try:
            found = hashlib.sha256(file.read_bytes()).hexdigest()
        except OSError as error:
            raise InputError(f"{file}: cannot be read ({error.strerror}); install kpopnet again") from error
        if found != expected:
            raise InputError(f"{file}: not the file that came with this version of kpopnet; install kpopnet again")
    return [FOLDER / name for name in SHA256[network]]
