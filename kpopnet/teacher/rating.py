"""The server of `kpopnet rate`: two learners beside their teacher, pair by pair, and what people answer.

The page gets joints only: no names of dances or learners, no ranks, no scores. Each answer is on the disk before the page hears
of it, so that a rater may stop, or this program be killed, at any moment.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from aiohttp import web

from kpopnet.dance.performance import Performance
from kpopnet.datasets.dances.dance_set import Dance, KpopSet, Learner
from kpopnet.datasets.dances.ratings import CHOICES, Answer, all_pairs, ratings_path, read_ratings, write_ratings
from kpopnet.errors import InputError
from kpopnet.runtime.input_files import check_fields, expect, parse_json
from kpopnet.teacher.hosting import page_app, sent
from kpopnet.teacher.pages import UNKNOWN
from kpopnet.teacher.posing import at_rate
from kpopnet.teacher.safety import Keys
from kpopnet.viz.view_page import millimetres, packed

FPS = 30.0
MAX_BYTES = 16_384
FLOOR_PERCENTILE = 2
"""Of the heights of all joints of a dance: where the floor is."""


@dataclass(frozen=True)
class Rating:
    """What is rated."""

    dances: KpopSet  # the set
    seed: int  # of the raters' orders
    joints: Callable[[Dance, Learner], Performance]  # those of a learner that are shown

    @cached_property
    def learners(self) -> dict[str, list[str]]:
        """Names of the learners by dance."""
        return {name: [one.name for one in self.dances.dance(name).learners] for name in self.dances.names}

    def state(self, rater: str) -> tuple[Path, list[Answer], list[Answer]]:
        """The file of a rater, the answers so far and the pairs to come; raises InputError for no name, or a damaged file."""
        path = ratings_path(self.dances.folder, rater)
        answers = read_ratings(path, self.learners)
        answered = {one.pair for one in answers}
        return path, answers, [one for one in all_pairs(self.learners, rater, self.seed) if one.pair not in answered]

    def figures(self, pair: Answer) -> dict:
        """The three dances of a pair, for the page."""
        dance = self.dances.dance(pair.dance)
        learners = {one.name: one for one in dance.learners}
        teacher = dance.teacher()
        shown = {"teacher": figure(teacher)}
        shown |= {side: figure(self.joints(dance, learners[getattr(pair, side)])) for side in ("left", "right")}
        return shown | {"from_s": float(teacher.times_s[0]), "to_s": float(teacher.times_s[-1])}


def figure(performance: Performance) -> dict:
    """A dance for the page: int16 millimetres, x right, y up from the floor, z to the viewer, above the middle of the way."""
    world_m = at_rate(performance, FPS) * [1, -1, -1]
    known = world_m[np.isfinite(world_m).all(axis=2)]
    expect(len(known) > 0, "a dance to be rated", "joints in some of its frames")
    middle_m = np.median(known, axis=0)
    middle_m[1] = np.percentile(known[:, 1], FLOOR_PERCENTILE)
    joints = packed(millimetres(world_m - middle_m))
    return {"fps": FPS, "begin_s": float(performance.times_s[0]), "joints_mm": joints}


RATING: web.AppKey[Rating] = web.AppKey("rating", Rating)
routes = web.RouteTableDef()


def make_rating_app(rating: Rating, hosts: tuple[str, ...], keys: Keys | None = None) -> web.Application:
    """The server's application; `hosts` and `keys` as in `safety.guard`."""
    app = page_app("rate.html", hosts, keys, MAX_BYTES)
    app[RATING] = rating
    app.add_routes(routes)
    return app


@routes.get("/api/pair")
async def pair(request: web.Request) -> web.Response:
    """The next pair of a rater, and how many are done."""
    rating = request.app[RATING]
    _, answers, left = rating.state(request.query.get("rater", ""))
    shown = await asyncio.to_thread(rating.figures, left[0]) if left else {}
    return web.json_response({"done": len(answers), "of": len(answers) + len(left), **shown})


@routes.post("/api/answer")
async def answer(request: web.Request) -> web.Response:
    """Writes an answer to the pair that comes after `done` others; without a choice, takes the last answer back."""
    schema, where = {"rater": str, "done": int, "choice": str}, "the page's message"
    given = check_fields(where, parse_json(await sent(request), where), schema)
    path, answers, left = request.app[RATING].state(given["rater"])
    if given["done"] != len(answers):
        raise InputError("this pair is answered already; reload the page")
    if given["choice"] == "":
        write_ratings(path, answers[:-1])
    elif given["choice"] in CHOICES and left:
        write_ratings(path, [*answers, replace(left[0], choice=given["choice"])])
    else:
        raise InputError(UNKNOWN)
    return web.json_response({})
