"""Files that are there whole or not at all, after a power cut and beside what killed processes left."""

import os
import socket
from pathlib import Path

import pytest

from kpopnet.runtime import atomic_write
from kpopnet.runtime.atomic_write import hidden_name, remove_unfinished, write_whole


def test_the_content_is_on_the_disk_before_the_file_has_its_name(tmp_path, monkeypatch):
    synced, sync = [], atomic_write.sync

    def seen(path: Path) -> None:
        synced.append((path, (tmp_path / "a").exists()))
        sync(path)

    monkeypatch.setattr(atomic_write, "sync", seen)
    write_whole(tmp_path / "a", "b")
    (part, was_there), (folder, is_there) = synced
    assert part.name.endswith(".tmp") and not was_there and folder == tmp_path and is_there


def test_the_longest_name_that_a_file_may_have_can_be_written(tmp_path):
    name = 127 * "é" + "a"  # 255 bytes
    write_whole(tmp_path / name, "b")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_hidden_name_has_whole_letters():
    for count in range(60, 85):
        name = hidden_name(count * "춤" + ".npz")
        assert name.encode() and len(name.encode()) <= 255  # half a letter could not be encoded


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc tells which processes have ended")
def test_what_processes_of_this_machine_left_that_have_ended_is_removed(tmp_path):
    host = socket.gethostname()
    ended, working, elsewhere = f".a.{host}.99999999-0.tmp", f".a.{host}.{os.getpid()}-0.tmp", ".a.other-host.99999999-0.tmp"
    for name in (ended, working, elsewhere, "a.tmp"):
        (tmp_path / name).touch()
    remove_unfinished(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {working, elsewhere, "a.tmp"}
