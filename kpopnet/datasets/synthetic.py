"""Benchmark `synthetic`: a frozen split of a set made by `synth`, with people that no training set contains."""

import numpy as np

from kpopnet.camera import depth_in_metres
from kpopnet.data.shards import ShardedSet
from kpopnet.datasets.protocol import BenchmarkConfig, Origin, Sequence
from kpopnet.errors import InputError


class SyntheticBenchmark:
    """Reads frozen shards; consecutive samples of one person in one room are one sequence of independent frames (stills).

    The generator puts several people into a room before one camera, and the last of them may go on in the next room. Intervals
    resample rooms as if they were independent: the people whom neighbouring rooms share are a small part of their samples.

    Joints that are not visible in the image have a true position too.
    """

    name = "synthetic"
    origin = Origin.SIMULATED
    truth = "synthetic truth"

    def __init__(self, config: BenchmarkConfig) -> None:
        """Opens the set; raises InputError if the folder holds no shards, or they are not frozen."""
        self.samples = ShardedSet(config.folder("a folder of frozen shards"))
        if self.samples.kind != "frozen":
            raise InputError(
                f"{config.path}: a {self.samples.kind} set without sensor noise; expected a frozen set: "
                "`python -m synth` freezes the split test by default, and others by frozen=[train,validation,test]"
            )
        header = self.samples.header
        version = header.config.get("generator")
        self.provenance = {"seed": header.seed, "version": version, "config_hash": header.config_hash}
        self.about = (
            f"Rendered people, split {header.split!r} of the set in {config.path} (seed {header.seed}, configuration "
            f"{header.config_hash}), with simulated sensor noise and simulated silhouette errors."
        )
        body, self._room = self.samples.column("body"), self.samples.room_numbers()
        changed = np.diff(body, prepend=body[0] - 1).astype(bool) | np.diff(self._room, prepend=-1).astype(bool)
        starts = np.flatnonzero(changed)
        stops = np.append(starts[1:], len(body))
        digits = len(str(len(body)))
        self._rows = {
            f"{start:0{digits}d}_body{body[start]}": range(start, stop) for start, stop in zip(starts, stops, strict=True)
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
            room=f"room {self._room[self._rows[name].start]}",
        )
