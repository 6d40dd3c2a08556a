"""Draws docs/figures/rooms.png: a frame of the first film of each kind of scene, and single images, with the true joints.

python tools/rooms_figure.py data/rooms docs/figures/rooms.png
"""

import sys
from pathlib import Path

from kpopnet.datasets.protocol import BenchmarkConfig
from kpopnet.datasets.simulated import PeopleSet
from kpopnet.viz.drawing import TRUE, save_png, sheet
from synth.simulated.rooms import SINGLE
from synth.simulated.sequences import frame_tile

COLUMNS, IMAGES = 5, 12

if __name__ == "__main__":
    rooms, tiles, kinds = PeopleSet(BenchmarkConfig("rooms", sys.argv[1])), [], []
    for name in rooms.names:
        stored = rooms.read(name)
        if kinds.count(stored.kind) < (IMAGES if stored.kind == SINGLE else 1):
            kinds.append(stored.kind)
            tiles.append(frame_tile(stored, len(stored.depth) // 2, stored.kind.replace("_", " ")))
    rows = [("", tiles[first : first + COLUMNS]) for first in range(0, len(tiles), COLUMNS)]
    save_png(Path(sys.argv[2]), sheet(rows, (TRUE,), "SIMULATED: rooms"))
