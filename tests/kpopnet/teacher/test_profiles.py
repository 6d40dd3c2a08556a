"""Profiles at the server's door: names, whose tries are whose, taking them along, deleting them."""

import io
import json
import zipfile

import pytest

pytest.importorskip("aiohttp", reason="the extra app is not installed")

from teacher_page import english, with_client

from kpopnet.errors import InputError
from kpopnet.teacher.profiles import Profile, Profiles


def profile_json(name) -> str:
    return json.dumps({"name": name})


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
        left = {path.name for path in teaching.tries.folder.rglob("*") if path.is_file()}
        assert left == {f"{name}.{kind}" for name in (guests, his) for kind in ("json", "npz")}
        assert (await client.get(f"/api/profiles/{mina}")).status == 400
        assert await (await client.get("/api/profiles")).json() == {theo: "Théo"}
        async with client.ws_connect("/live") as socket:
            await socket.send_json({"do": "prepare", "lesson": {"dance": "dance_001", "who": mina}})
            assert "no such profile" in english((await socket.receive_json())["text"])

    with_client(teaching, work)


def test_strange_names_and_messages_are_refused_and_never_become_paths(teaching):
    wrong = [profile_json(one) for one in ("", " a", "a" * 41, "a\nb", "\ud800", 3, "MINA")]

    async def work(client):
        assert (await client.post("/api/profiles", data=profile_json("Mina"))).status == 200
        assert (await client.post("/api/profiles", data=profile_json("../../x"))).status == 200  # a name like another
        for data in (*wrong, "", "[]", "{}", '{"name": "A", "age": 3}', "x" * 100):
            answer = await client.post("/api/profiles", data=data)
            assert answer.status == 400 and "\n" not in (await answer.json())["error"], data
        for who in ("..%2ftries", "p_00000000", "p_0000000", "x" * 300):
            for ask in (client.get, client.delete):
                assert (await ask(f"/api/profiles/{who}")).status == 400
            assert (await client.get(f"/api/profiles/{who}.zip")).status == 400
        assert (await client.delete("/api/profiles/p_00000000", headers={"Origin": "http://evil.example"})).status == 403

    with_client(teaching, work)
    folder = teaching.tries.folder.parent / "profiles"
    assert len(list(folder.iterdir())) == 2 and not list(folder.parent.rglob("x*"))


def test_a_damaged_profile_is_left_out(teaching, tmp_path):
    profiles = Profiles(tmp_path / "profiles", teaching.tries)
    who = profiles.add(Profile("Mina"))
    (tmp_path / "profiles" / f"{who}.json").write_text("{")
    assert profiles.names() == {}
    with pytest.raises(InputError):
        profiles.profile(who)
