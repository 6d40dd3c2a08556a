"""The networks that come with the package. `NetworkEstimator()` loads the one of joints, a checkpoint without training state.

    model.safetensors              its filters in float16, the rest in float32; torch computes in float32
    meta.json                      its description, as in every checkpoint (kpopnet.networks)
    person.safetensors             its head that judges whether a crop shows a person
    finder.safetensors             the finder of people, stored likewise
    masks.safetensors              its mask network, which says which pixels are theirs, stored likewise
    *graph.onnx                    these three for ONNX Runtime, without their filters; in 8 bits where tools/eight_bits.py says
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
        "model.safetensors": "95184bbbf4bbd8d93f72bb3d631cf5dd63166244931201855e9842badb1d1315",
        "meta.json": "dbea9967f407cb9f985e8186f3ed5ed1b7757f8a5ce741fb956b7cd51dc54914",
        "person.safetensors": "47ed4e2e4f92202636f3b55663f2b02d9a7bc0691cd4d1c4f33318d3ee3c5f5d",
        "graph.onnx": "9f154288926ad4a2d34c83f95ed6c253e0b8442614cf5365e54a624879cf3b0d",
    },
    "finder": {
        "finder.safetensors": "55314707dd7e2e31d185173ca28dcf94dc1a4ec2332f9e9c460e161d9afc55eb",
        "finder_graph.onnx": "5d0a4cb67757bf61e01648233d831d67549e2f5b545f6da327238f13a82426f8",
    },
    "masks": {
        "masks.safetensors": "b53536402cc7f27da10d08cb721b88ce2395e100190141a899164e38fa3941b3",
        "masks_graph.onnx": "f323daa4a4c2106394da52162ebf8cac60d8b4234e642ccb36844333203f87ce",
    },
    "over_time": {
        "over_time_causal.safetensors": "5fd8a1aa9101f74f15f1d2fd0d1aaed408ded538ebdc27fff0604cdd01f5ce79",
        "over_time_future.safetensors": "78eca08aa20a7779b11a6f88b3b99d74e2393b5f2ad4df9fbe7046beb2234948",
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
