"""Benchmark `synthetic`: held-out people that `synth` rendered and froze, with noise and imperfect silhouettes."""

from dataclasses import dataclass

import numpy as np

from kpopnet.benchmarks.sequences import Origin, Sequence
from kpopnet.camera import depth_in_metres
from kpopnet.errors import InputError
from kpopnet.shards import ShardedSet


@dataclass
class SyntheticConfig:
    """Attributes: path: a folder of frozen shards."""

    name: str = "synthetic"
    path: str = "data/small/test"


class SyntheticBenchmark:
    """Consecutive samples of one person are one sequence; its frames are stills, not a film.

    Every joint has a truth, also those that nobody can see in the picture; `visible` tells them apart. `measured_with`
    holds the settings of the sensor and the extraction that were imitated, as the set itself says.
    """

    name = "synthetic"
    origin = Origin.SIMULATED
    truth = "synthetic truth"

    def __init__(self, config: SyntheticConfig) -> None:
        """Opens the set.

        Raises:
            InputError: there are no shards, or they are clean ones.
        """
        self.samples = ShardedSet(config.path)
        if self.samples.kind != "frozen":
            raise InputError(
                f"{config.path}: a {self.samples.kind} set is a perfect camera's and no test; benchmarks read a frozen "
                "one, whose noise is the same for everybody. `python -m synth` freezes the split test by default, and "
                "others by frozen=[train,validation,test]; then give benchmark.path=FOLDER"
            )
        header = self.samples.header
        self.measured_with: dict[str, dict] = header.config.get("freeze", {})
        self.provenance = {
            "seed": header.seed,
            "version": header.config.get("generator"),
            "config_hash": header.config_hash,
        }
        self.about = (
            f"Rendered people, split {header.split!r} of the set in {config.path} (seed {header.seed}, configuration "
            f"{header.config_hash}); the sensor's noise and the silhouettes' faults are simulated too."
        )
        body = self.samples.column("body")
        starts = np.flatnonzero(np.diff(body, prepend=body[0] - 1))
        stops = np.append(starts[1:], len(body))
        digits = len(str(len(body)))
        self._rows = {
            f"{start:0{digits}d}_body{body[start]}": range(start, stop)
            for start, stop in zip(starts, stops, strict=True)
        }

    def sequence_names(self) -> list[str]:
        return list(self._rows)

    def read(self, name: str) -> Sequence:
        rows = [self.samples[index] for index in self._rows[name]]
        return Sequence(
            name=name,
            identity=str(rows[0].body),
            fps=0.0,
            camera=self.samples.camera,
            depth_m=depth_in_metres(np.stack([row.depth_mm for row in rows]), self.samples.camera, where=name),
            joints_camera_m=np.stack([row.joints_camera_m for row in rows]),
            visible=np.stack([row.visible for row in rows]),
            yaw_rad=np.array([row.yaw_rad for row in rows], np.float32),
        )
