"""What generators tidy up."""

import subprocess
import sys

from programs import ROOT

from kpopnet.runtime.folder_lock import locked
from synth.resumable import remove_unfinished

REMOVE = (
    "import sys; from pathlib import Path; from synth.resumable import remove_unfinished as r; r(Path(sys.argv[1]), '.*.tmp')"
)


def test_the_hidden_file_of_a_living_process_stays(tmp_path):
    unfinished = tmp_path / ".shard_00003.h5.here.1.tmp"
    unfinished.write_text("")
    with locked(tmp_path, range(3, 4)):
        subprocess.run([sys.executable, "-c", REMOVE, str(tmp_path)], cwd=ROOT)
        assert unfinished.exists()
        remove_unfinished(tmp_path, ".*.tmp")
    assert not list(tmp_path.iterdir())
