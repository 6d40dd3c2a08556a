"""The server of `kpopnet rate` over HTTP: blind, in each rater's own order, every answer on the disk at once."""

import base64
import json

import numpy as np
import pytest

pytest.importorskip("aiohttp", reason="the extra app is not installed")

from rated_sets import SKILLS_M, write_set
from teacher_page import with_client, with_its_client

from kpopnet.datasets.dances.dance_set import KpopSet
from kpopnet.datasets.dances.ratings import all_pairs, ratings_path, read_ratings
from kpopnet.skeleton import NUM_JOINTS, Joint
from kpopnet.teacher.rating import Rating, figure

PAIRS = 2 * 3 + 2
"""Of two dances with three learners, each with one pair that is shown again."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return write_set(tmp_path_factory.mktemp("set"), labels=True)


@pytest.fixture
def rating(made, tmp_path):
    """What is rated, in a folder of its own: what the set holds, and no ratings."""
    for place in made.iterdir():
        (tmp_path / place.name).symlink_to(place)
    return Rating(KpopSet(tmp_path, ranked=False), 0, lambda dance, learner: learner.joints())


async def asked(client, rater):
    return await client.told("/api/pair", params={"rater": rater})


async def say(client, rater, done, choice, status=200):
    given = {"rater": rater, "done": done, "choice": choice}
    return await client.told("/api/answer", status, "POST", data=json.dumps(given))


def stored(rating, rater):
    return read_ratings(ratings_path(rating.dances.folder, rater), rating.learners)


def test_pairs_are_blind_and_answers_name_the_learners_as_they_were_shown(rating):
    """What the page gets for all pairs: numbers and joints, no name of a learner or a dance, no rank, no score."""

    async def work(client):
        texts = []
        for done in range(PAIRS):
            answer = await client.get("/api/pair", params={"rater": "eve"})
            texts.append(str(answer.headers) + await answer.text())
            await say(client, "eve", done, "right")
        return texts

    texts, answers = with_client(rating, work), stored(rating, "eve")
    assert [one.pair for one in answers] == [one.pair for one in all_pairs(rating.learners, "eve", 0)]
    for text, answer in zip(texts, answers, strict=True):
        content = json.loads(text[text.index('{"done"') :])
        assert set(content) == {"done", "of", "from_s", "to_s", "teacher", "left", "right"}
        learners = {one.name: one for one in rating.dances.dance(answer.dance).learners}
        assert answer.choice == "right"
        for side in ("left", "right"):
            assert content[side] == figure(learners[getattr(answer, side)].joints())
        for side in ("teacher", "left", "right"):
            assert set(content[side]) == {"fps", "begin_s", "joints_mm"}
            text = text.replace(content[side]["joints_mm"], "")  # base64, which holds any three letters
        assert not any(word in text for word in (*SKILLS_M, "dance_", "rank", "score", "repeat"))


def test_a_figure_stands_upright_on_the_floor_and_misses_what_is_missing(rating):
    performance = rating.dances.dance("dance_0").teacher()
    performance.joints_m[:, Joint.LEFT_HAND] = np.nan
    joints_mm = np.frombuffer(base64.b64decode(figure(performance)["joints_mm"]), "<i2").reshape(-1, NUM_JOINTS, 3)
    assert (joints_mm[:, Joint.LEFT_HAND] == -32768).all()
    head, feet = joints_mm[:, Joint.HEAD], joints_mm[:, [Joint.LEFT_FOOT, Joint.RIGHT_FOOT]]
    assert (head[:, 1] > 1000).all() and -150 < feet[..., 1].min() < 50
    assert abs(np.median(joints_mm[:, Joint.TORSO, [0, 2]])) < 100
    known = [joint for joint in Joint if joint is not Joint.LEFT_HAND]
    for at, sign in enumerate((1, -1, -1)):  # as the camera saw it, not its mirror image; up, and to the viewer
        seen_m = performance.joints_m[0, known, at] - performance.joints_m[0, Joint.TORSO, at]
        shown = joints_mm[0, known, at].astype(int) - joints_mm[0, Joint.TORSO, at]
        np.testing.assert_allclose(shown, 1000 * sign * seen_m, atol=2)


def test_two_raters_go_on_where_they_stopped_on_another_server(rating):
    async def first(client):
        for done, choice in enumerate(("left", "right", "equal")):
            await say(client, "eve", done, choice)
        await say(client, "fay 2", 0, "right")

    async def second(client):
        one, other = await asked(client, "eve"), await asked(client, "fay 2")
        assert [(found["done"], found["of"]) for found in (one, other)] == [(3, PAIRS), (1, PAIRS)]
        for done in range(3, PAIRS):
            await say(client, "eve", done, "left")
        assert await asked(client, "eve") == {"done": PAIRS, "of": PAIRS}
        await say(client, "eve", PAIRS, "left", 400)

    with_client(rating, first)
    with_client(rating, second)
    assert [one.choice for one in stored(rating, "eve")[:3]] == ["left", "right", "equal"]
    assert [one.choice for one in stored(rating, "fay 2")] == ["right"]


@with_its_client
async def test_an_answer_counts_once_and_may_be_taken_back(client, rating):
    before = await asked(client, "eve")
    await say(client, "eve", 0, "left")
    assert "answered already" in (await say(client, "eve", 0, "right", 400))["error"]  # a second tab, or a key pressed twice
    assert [one.choice for one in stored(rating, "eve")] == ["left"]
    await say(client, "eve", 1, "equal")
    await say(client, "eve", 2, "")
    assert [one.choice for one in stored(rating, "eve")] == ["left"]
    await say(client, "eve", 1, "")
    assert await asked(client, "eve") == before and stored(rating, "eve") == []


@with_its_client
async def test_wrong_messages_and_damaged_files_get_one_clear_sentence_and_write_nothing(client, rating):
    folder = rating.dances.folder
    for content, message in (
        (b"", "not valid JSON"),
        (b'{"rater": "eve", "done": 0}', "lacks choice"),
        (b'{"rater": "eve", "done": 0, "choice": "best"}', "unknown"),
        (b'{"rater": "../eve", "done": 0, "choice": "left"}', "a rater's name"),
    ):
        assert message in await client.refused("/api/answer", method="POST", data=content)
    assert not list(folder.rglob("*eve*"))
    path = ratings_path(folder, "eve")
    path.parent.mkdir()
    path.write_text('{"answers": [')
    for told in (await client.told("/api/pair?rater=eve", 400), await say(client, "eve", 0, "left", 400)):
        assert "eve.json" in told["error"]
    assert path.read_text() == '{"answers": ['
