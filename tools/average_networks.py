"""Averages the weights of a trained network and of the network that its training began with.

    python tools/average_networks.py kpopnet/weights outputs/train/RUN/last --share 0.6 --out outputs/train/RUN/average

A training on other images makes a network better there and somewhat worse elsewhere; between both lie networks that are better
in both (Wortsman et al. 2022, Robust fine-tuning of zero-shot models). --share is the trained network's. Writes a checkpoint
that `training.start`, tools/fit_person.py and tools/ship_weights.py take. Run from the root of a checkout with `PYTHONPATH=.`.
"""

import argparse
from pathlib import Path

import safetensors.torch
import torch

from kpopnet.errors import InputError, check_between
from kpopnet.networks import META, WEIGHTS
from kpopnet.networks.checkpoint import load_network
from kpopnet.runtime.atomic_write import write_json, write_whole
from kpopnet.runtime.endings import user_errors


def average(before: Path, after: Path, share: float, out: Path) -> None:
    """Writes the checkpoint `out`; raises InputError for networks of two models, and a folder that exists."""
    check_between("--share", share, 0, 1)
    if out.exists():
        raise InputError(f"{out}: exists already; give another folder (--out)")
    (old, _), (new, meta) = load_network(before), load_network(after)
    if old.config != new.config:
        raise InputError(f"{before} and {after}: networks of two models, {old.config} and {new.config}")
    began_with, weights = old.state_dict(), new.state_dict()
    own = {name: value for name, value in weights.items() if not name.startswith("person.")}
    mixed = {
        name: torch.lerp(began_with[name].double(), value.double(), share).to(value.dtype).contiguous()
        if value.is_floating_point()
        else value
        for name, value in own.items()
    }
    out.mkdir(parents=True)
    write_whole(out / WEIGHTS, safetensors.torch.save(mixed))
    write_json(out / META, meta | {"averaged": {"share": share}})


@user_errors
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=Path, help="folder of the checkpoint that the training began with")
    parser.add_argument("after", type=Path, help="folder of the trained checkpoint")
    parser.add_argument("--share", type=float, default=0.6, help="of the trained one: %(default)s")
    parser.add_argument("--out", type=Path, required=True, help="folder of the new checkpoint")
    given = parser.parse_args()
    average(given.before, given.after, given.share, given.out)
    print(f"wrote {given.out}")


if __name__ == "__main__":
    main()
