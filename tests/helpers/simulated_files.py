"""Small simulated sets in the format of `kpopnet.datasets.simulated`."""

import json
from dataclasses import replace
from pathlib import Path

from kpopnet.datasets.simulated import StoredSequence, write_sequence


def write_simulated(folder: Path, benchmark: str, files: dict[str, StoredSequence], **changes: object) -> None:
    """Writes sequences by name, and a manifest with changed entries."""
    folder.mkdir(parents=True, exist_ok=True)
    manifest = {
        "simulated": True, "benchmark": benchmark, "about": "SIMULATED by a test.", "truth": "synthetic truth", "seed": 3,
        "hash": "0" * 12, "sequences": len(files), "config": {"generator": 2},
    }  # fmt: skip
    (folder / "manifest.json").write_text(json.dumps(manifest | changes))
    for name, sequence in files.items():
        write_sequence(folder, replace(sequence, name=name))
