"""Profiles at the server's door: names, whose tries are whose, taking them along, deleting them."""

import errno
import io
import json
import os
import zipfile
from unittest.mock import Mock

import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="the extra app is not installed")

from teacher_page import english, with_its_client

from kpopnet.errors import InputError
from kpopnet.runtime.atomic_write import hidden_name
from kpopnet.teacher.profiles import Profile


def adding(name) -> dict:
    """How a profile is asked for."""
    return {"method": "POST", "data": json.dumps({"name": name})}


def left(folder) -> set[str]:
    """The names of the files under a folder."""
    return {path.name for path in folder.rglob("*") if path.is_file()}


def test_names_of_any_script_are_shown():
    assert Profile("山田\u3000太郎").name == "山田 太郎" and Profile("Zoe\u0301").name == "Zoé"
    for name in ("", " a", "a\u3000", "a\nb", "x" * 41, "\u202eb"):
        with pytest.raises(InputError, match="letters that can be printed"):
            Profile(name)


@with_its_client
async def test_a_profile_has_its_own_history_which_is_exported_and_deleted(client, teaching, tried):
    mina, theo = [(await client.told("/api/profiles", **adding(one)))["who"] for one in ("Mina", "Théo")]
    assert await client.told("/api/profiles") == {mina: "Mina", theo: "Théo"}
    guests, hers, his = tried(20.0), tried(20.0, who=mina), tried(20.0, who=theo)
    for who, name in (("", guests), (mina, hers), (theo, his)):
        history = await client.told(f"/api/history/dance_001?who={who}")
        assert [one["session"] for one in history] == [name]
    shown = await client.told(f"/api/profiles/{mina}")
    assert shown["name"] == "Mina" and [one["session"] for one in shown["dances"][0]["tries"]] == [hers]
    packed = zipfile.ZipFile(io.BytesIO(await (await client.get(f"/api/profiles/{mina}.zip")).read()))
    assert set(packed.namelist()) == {"profile.json"} | {f"tries/dance_001/{hers}.{kind}" for kind in ("json", "npz")}
    teaching.tries.film_path("dance_001", hers).write_bytes(b"film")
    await client.told(f"/api/profiles/{mina}", method="DELETE")
    assert left(teaching.tries.folder) == {f"{name}.{kind}" for name in (guests, his) for kind in ("json", "npz")}
    await client.refused(f"/api/profiles/{mina}")
    async with client.ws_connect("/live") as socket:
        await socket.send_json({"do": "prepare", "lesson": {"dance": "dance_001", "who": mina}})
        assert "no such profile" in english((await socket.receive_json())["text"])
    assert await client.told("/api/profiles") == {theo: "Théo"}
    (teaching.profiles.folder / f"{theo}.json").write_text("{")
    assert await client.told("/api/profiles") == {}  # a damaged one is left out


@with_its_client
async def test_strange_names_and_messages_are_refused_and_never_become_paths(client, teaching):
    for name in ("Mina", "../../x"):  # a name like another
        await client.told("/api/profiles", **adding(name))
    for wrong in ("", " a", "a" * 41, "a\nb", "\ud800", 3, "MINA"):
        await client.refused("/api/profiles", **adding(wrong))
    for data in ("", "[]", '{"name": "A", "age": 3}', b'\xff\xfe{"name": "A"}'):
        await client.refused("/api/profiles", method="POST", data=data)
    for who in ("..%2ftries", "p_00000000", "x" * 300):
        for path, method in ((who, "GET"), (f"{who}.zip", "GET"), (who, "DELETE")):
            await client.refused(f"/api/profiles/{path}", method=method)
    await client.told("/api/profiles/p_00000000", 403, "DELETE", headers={"Origin": "http://evil.example"})
    folder = teaching.profiles.folder
    assert len(list(folder.iterdir())) == 2 and not list(folder.parent.rglob("x*"))


def test_nothing_is_left_of_a_profile_that_is_deleted_while_its_try_is_saved_or_filmed(teaching, tried, monkeypatch):
    tries, profiles = teaching.tries, teaching.profiles
    who, save = profiles.add(Profile("Mina")), tries.save
    name = tried(2.0, who=who)
    (tries.folder / "dance_001" / hidden_name(f"{name}.mp4")).write_bytes(b"half a film")
    monkeypatch.setattr(tries, "save", lambda *given: [profiles.delete(who), save(*given)][1])
    with pytest.raises(InputError, match="no such profile"):
        profiles.keep({"dance": "dance_001", "who": who}, {"times_s": np.zeros(1)})
    assert left(tries.folder) == left(profiles.folder) == set()


def test_a_try_of_no_profile_is_kept(teaching):
    name = teaching.profiles.keep({"dance": "dance_001", "who": ""}, {"times_s": np.zeros(1)})
    assert left(teaching.tries.folder) == {f"{name}.json", f"{name}.npz"}


def test_a_try_that_a_full_disk_or_a_kill_interrupts_leaves_no_joints(teaching, tried, monkeypatch):
    tries, profiles = teaching.tries, teaching.profiles
    for place, name in ((np, "savez_compressed"), (json, "dumps")):
        with monkeypatch.context() as patched:
            patched.setattr(place, name, Mock(side_effect=OSError(errno.ENOSPC, "No space left on device")))
            with pytest.raises(OSError, match="No space"):
                tried(1.0)
    assert left(tries.folder) == set()
    killed, saving = tried(1.0), tried(1.0)
    for one in (killed, saving):
        tries.path("dance_001", one, "json").unlink()
    os.utime(tries.folder / "dance_001" / f"{killed}.npz", (0, 0))
    profiles.delete(profiles.add(Profile("Mina")))
    assert left(tries.folder) == {f"{saving}.npz"}
