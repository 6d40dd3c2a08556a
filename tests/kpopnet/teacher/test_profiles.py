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

from teacher_page import english, with_client

from kpopnet.errors import InputError
from kpopnet.runtime.atomic_write import hidden_name
from kpopnet.teacher.profiles import Profile


def profile_json(name) -> str:
    return json.dumps({"name": name})


def left(folder) -> set[str]:
    """The names of the files under a folder."""
    return {path.name for path in folder.rglob("*") if path.is_file()}


def test_a_profile_has_its_own_history_which_is_exported_and_deleted(teaching, tried):
    async def work(client):
        mina, theo = [
            (await (await client.post("/api/profiles", data=profile_json(one))).json())["who"] for one in ("Mina", "Théo")
        ]
        assert await (await client.get("/api/profiles")).json() == {mina: "Mina", theo: "Théo"}
        guests, hers, his = tried(20.0), tried(20.0, who=mina), tried(20.0, who=theo)
        for who, name in (("", guests), (mina, hers), (theo, his)):
            history = await (await client.get(f"/api/history/dance_001?who={who}")).json()
            assert [one["session"] for one in history] == [name]
        shown = await (await client.get(f"/api/profiles/{mina}")).json()
        assert shown["name"] == "Mina" and [one["session"] for one in shown["dances"][0]["tries"]] == [hers]
        packed = zipfile.ZipFile(io.BytesIO(await (await client.get(f"/api/profiles/{mina}.zip")).read()))
        assert set(packed.namelist()) == {"profile.json"} | {f"tries/dance_001/{hers}.{kind}" for kind in ("json", "npz")}
        teaching.tries.film_path("dance_001", hers).write_bytes(b"film")
        assert (await client.delete(f"/api/profiles/{mina}")).status == 200
        assert left(teaching.tries.folder) == {f"{name}.{kind}" for name in (guests, his) for kind in ("json", "npz")}
        assert (await client.get(f"/api/profiles/{mina}")).status == 400
        async with client.ws_connect("/live") as socket:
            await socket.send_json({"do": "prepare", "lesson": {"dance": "dance_001", "who": mina}})
            assert "no such profile" in english((await socket.receive_json())["text"])
        assert await (await client.get("/api/profiles")).json() == {theo: "Théo"}
        (teaching.profiles.folder / f"{theo}.json").write_text("{")
        assert await (await client.get("/api/profiles")).json() == {}  # a damaged one is left out

    with_client(teaching, work)


def test_strange_names_and_messages_are_refused_and_never_become_paths(teaching):
    wrong = [profile_json(one) for one in ("", " a", "a" * 41, "a\nb", "\ud800", 3, "MINA")]

    async def work(client):
        assert (await client.post("/api/profiles", data=profile_json("Mina"))).status == 200
        assert (await client.post("/api/profiles", data=profile_json("../../x"))).status == 200  # a name like another
        for data in (*wrong, "", "[]", '{"name": "A", "age": 3}'):
            answer = await client.post("/api/profiles", data=data)
            assert answer.status == 400 and "\n" not in english((await answer.json())["error"]), data
        for who in ("..%2ftries", "p_00000000", "x" * 300):
            for ask in (client.get, client.delete):
                assert (await ask(f"/api/profiles/{who}")).status == 400
            assert (await client.get(f"/api/profiles/{who}.zip")).status == 400
        assert (await client.delete("/api/profiles/p_00000000", headers={"Origin": "http://evil.example"})).status == 403

    with_client(teaching, work)
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
