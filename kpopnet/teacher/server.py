"""The local server: the page, the dances, the tries, and a WebSocket for each lesson."""

import asyncio
import contextlib
import json
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from aiohttp import web

from kpopnet.dance.joint_files.reader import SUFFIXES, read_page_recording, read_strangers_performance
from kpopnet.dance.performance import Performance
from kpopnet.errors import InputError, check_between
from kpopnet.languages import Said, keyed
from kpopnet.runtime.input_files import check_fields, parse_json, settings_from
from kpopnet.teacher.adding import USUAL_BPM, add_group
from kpopnet.teacher.film import Filming
from kpopnet.teacher.hosting import page_app, sent
from kpopnet.teacher.library import About, Library, moves_cm, preview_cm
from kpopnet.teacher.live.lesson import CameraOpener, Lesson
from kpopnet.teacher.live.process import LessonProcess, LessonProcesses
from kpopnet.teacher.live.webcam import read_seen
from kpopnet.teacher.pages import UNKNOWN, Page, add_pages
from kpopnet.teacher.posing import Movement, as_bvh, learners_movement
from kpopnet.teacher.profiles import Profile, Profiles
from kpopnet.teacher.result_page import packed_body, packed_movement
from kpopnet.teacher.safety import Keys
from kpopnet.teacher.tries import Tries, as_csv

MAX_UPLOAD_BYTES, MAX_MESSAGE_BYTES = 32_000_000, 16_384


@dataclass(frozen=True)
class Teaching:
    """Everything that the server serves."""

    library: Library
    tries: Tries
    open_camera: CameraOpener
    checkpoint: str | None  # of `load_estimator`
    sources: dict[str, str]  # names of the sources of depth to their descriptions
    skills: tuple[str, ...]  # of a simulated learner
    faults: tuple[str, ...]  # of a simulated learner

    @property
    def profiles(self) -> Profiles:
        """Those whose tries these are."""
        return Profiles(self.tries.folder.parent / "profiles", self.tries)


TEACHING: web.AppKey[Teaching] = web.AppKey("teaching", Teaching)
FILMING: web.AppKey[Filming] = web.AppKey("filming", Filming)
routes = web.RouteTableDef()


def make_app(teaching: Teaching, hosts: tuple[str, ...], keys: Keys | None = None, ready: bool = False) -> web.Application:
    """The server's application; `hosts` and `keys` as in `safety.guard`; `ready`: a process waits for the first lesson."""
    app, films = page_app("index.html", hosts, keys, MAX_UPLOAD_BYTES), Filming(teaching.library, teaching.tries)
    app[TEACHING], app[FILMING], processes = teaching, films, LessonProcesses(teaching.open_camera, teaching.checkpoint)

    async def make_ready(_app: web.Application) -> None:
        processes.keep_ready()

    async def end_films(_app: web.Application) -> None:
        films.end()

    async def end_processes(_app: web.Application) -> None:
        await asyncio.to_thread(processes.end)

    app.add_routes(routes)
    if ready:
        app.on_startup.append(make_ready)
    app.on_shutdown.append(end_films)
    add_pages(app, partial(LessonPage, teaching=teaching, processes=processes), MAX_MESSAGE_BYTES)
    app.on_shutdown.append(end_processes)
    return app


@routes.get("/api/offer")
async def offer(request: web.Request) -> web.Response:
    teaching = request.app[TEACHING]
    return web.json_response({"sources": keyed(teaching.sources), "skills": teaching.skills, "faults": teaching.faults})


@routes.get("/api/dances")
async def dances(request: web.Request) -> web.Response:
    """What the menu shows; of a damaged dance, why it cannot be danced."""
    library, shown = request.app[TEACHING].library, []
    for identity in library.identities():
        try:
            shown.append(_shown(identity, library.about(identity)))
        except InputError as error:
            shown.append({"identity": identity, "name": identity, "broken": keyed(error.said)})
    return web.json_response(shown)


@routes.get("/api/dances/{identity}")
async def dance(request: web.Request) -> web.Response:
    library, identity = request.app[TEACHING].library, request.match_info["identity"]
    return web.json_response(text=await asyncio.to_thread(_dance_text, library, identity))


def _dance_text(library: Library, identity: str) -> str:
    """A dance as JSON: of a long one of a group it takes half a second, in which the lessons of other pages go on."""
    found = library.dance(identity)
    starts_m = np.nan_to_num([one.start_m[[0, 2]] for one in found.dancers])
    first, *others = [
        packed_movement(Movement(one.quats, one.hips_m, one.fps)) | {"place_m": place_m, "moves": moves_cm(one)}
        for one, place_m in zip(found.dancers, (starts_m - starts_m.mean(axis=0)).round(3).tolist(), strict=True)
    ]
    return json.dumps(_shown(identity, found.about) | first | {"others": others})


def _shown(identity: str, about: About) -> dict:
    return asdict(about) | {"identity": identity, "phrase_s": about.phrase_s}


@routes.get("/api/dances/{identity}/preview")
async def preview(request: web.Request) -> web.Response:
    library, identity = request.app[TEACHING].library, request.match_info["identity"]
    return web.json_response(await asyncio.to_thread(lambda: preview_cm(library.dance(identity))))


@routes.post("/api/dances")
async def upload(request: web.Request) -> web.Response:
    """Adds a dance: the file is the body, its name, the dance's title and, where known, its beats a minute are in the query."""
    suffix = Path(request.query.get("file", "")).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(Said("a dance is a file that ends with {endings}", endings=SUFFIXES))
    return await _added(request, await _read(request, read_strangers_performance, suffix), Said("the file"))


@routes.post("/api/recordings")
async def keep_recording(request: web.Request) -> web.Response:
    """Adds a dance that the page recorded: the body is as `recorded` takes it, the query as of `upload`."""
    return await _added(request, await _read(request, read_page_recording, ".json"), Said("the recording"))


async def _read(request: web.Request, reader: Callable[[Path], Performance], suffix: str) -> Performance:
    """The dance of a request's body, read by a process with limits."""
    content = await sent(request)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"dance{suffix}"
        path.write_bytes(content)
        try:
            return await asyncio.to_thread(reader, path)
        except InputError as error:
            raise InputError(str(error).replace(str(path), "the file")) from error


async def _added(request: web.Request, performance: Performance, where: Said) -> web.Response:
    title = request.query.get("title", "").strip()[:60] or "My dance"
    try:
        bpm = float(request.query.get("bpm", USUAL_BPM))
    except ValueError as error:
        raise InputError("bpm: expected a number") from error
    check_between("bpm", bpm, 20, 400)
    added = await asyncio.to_thread(add_group, request.app[TEACHING].library, [performance], where, title, bpm)
    return web.json_response({"identity": added})


@routes.get("/api/body")
async def body(request: web.Request) -> web.Response:
    return web.json_response(packed_body(request.app[TEACHING].library.body))


@routes.get("/api/history/{dance}")
async def history(request: web.Request) -> web.Response:
    """The tries of a dance by the profile `who`, or those without a profile."""
    tries, who = request.app[TEACHING].tries, request.query.get("who", "")
    return web.json_response(await asyncio.to_thread(tries.history, request.match_info["dance"], who))


@routes.get("/api/profiles")
async def names(request: web.Request) -> web.Response:
    return web.json_response(request.app[TEACHING].profiles.names())


@routes.post("/api/profiles")
async def add_profile(request: web.Request) -> web.Response:
    """Adds a profile; the body is the JSON of a `Profile`."""
    profile = settings_from(Profile, parse_json(await sent(request), "the page's message"), "the profile")
    return web.json_response({"who": request.app[TEACHING].profiles.add(profile)})


@routes.get(r"/api/profiles/{who}.zip")
async def export(request: web.Request) -> web.Response:
    content = await asyncio.to_thread(request.app[TEACHING].profiles.export, request.match_info["who"])
    attachment = {"Content-Disposition": 'attachment; filename="my-dances.zip"'}
    return web.Response(body=content, content_type="application/zip", headers=attachment)


@routes.delete("/api/profiles/{who}")
async def delete(request: web.Request) -> web.Response:
    await asyncio.to_thread(request.app[TEACHING].profiles.delete, request.match_info["who"])
    return web.json_response({})


@routes.get("/api/profiles/{who}")
async def profile(request: web.Request) -> web.Response:
    """A profile's name, and its tries by dance, with what the menu shows of each dance that is still there."""
    teaching, who = request.app[TEACHING], request.match_info["who"]
    shown = {"name": teaching.profiles.profile(who).name, "dances": []}
    for dance in teaching.tries.dances():
        with contextlib.suppress(InputError):  # the dance is gone
            about = _shown(dance, teaching.library.about(dance))
            if tries := await asyncio.to_thread(teaching.tries.history, dance, who):
                shown["dances"].append(about | {"tries": tries})
    return web.json_response(shown)


@routes.get(r"/api/tries/{dance}/{name}.{kind:json|csv|bvh|mp4}")
async def session(request: web.Request) -> web.StreamResponse:
    """A try as a file: result, course, the learner's movement, or the film, when it is made."""
    teaching, kind = request.app[TEACHING], request.match_info["kind"]
    dance, name = request.match_info["dance"], request.match_info["name"]
    attachment = {"Content-Disposition": f'attachment; filename="{dance}-{name}.{kind}"'}
    if kind == "mp4":
        path = teaching.tries.film_path(dance, name)
        if not path.is_file():
            raise InputError("this film is not made yet")
        return web.FileResponse(path, headers=attachment)
    result = teaching.tries.result(dance, name)
    if kind == "json":
        return web.json_response(result, headers=attachment)
    if kind == "csv":
        return web.Response(text=as_csv(result), content_type="text/csv", headers=attachment)
    text = await asyncio.to_thread(_learners_bvh, teaching, dance, name)
    return web.Response(text=text, content_type="text/plain", headers=attachment)


@routes.post("/api/tries/{dance}/{name}/film")
async def make_film(request: web.Request) -> web.StreamResponse:
    """Makes the film of a try while the page listens: lines of JSON, how much is done or what went wrong."""
    dance, name = request.match_info["dance"], request.match_info["name"]
    request.app[TEACHING].tries.film_path(dance, name)
    response = web.StreamResponse(headers={"Content-Type": "application/x-ndjson"})
    await response.prepare(request)

    async def tell(message: dict) -> None:
        await response.write(json.dumps(message).encode() + b"\n")

    with contextlib.suppress(ConnectionError):  # the page has gone
        async with contextlib.aclosing(request.app[FILMING].make(dance, name)) as fractions:
            try:
                async for fraction in fractions:
                    await tell({"fraction": round(fraction, 3)})
                await tell({"fraction": 1})
            except InputError as error:
                await tell({"error": keyed(error.said)})
    return response


@routes.get("/api/tries/{dance}/{name}/movement")
async def movement(request: web.Request) -> web.Response:
    """The learner's movement in a try on the teacher's body, for the replay."""
    dance, name = request.match_info["dance"], request.match_info["name"]
    teaching = request.app[TEACHING]
    return web.json_response(await asyncio.to_thread(lambda: packed_movement(_learners_movement(teaching, dance, name))))


def _learners_movement(teaching: Teaching, dance: str, name: str) -> Movement:
    learner = teaching.tries.joints(dance, name)
    return learners_movement(learner, teaching.library.dance(dance).fps, teaching.library.body)


def _learners_bvh(teaching: Teaching, dance: str, name: str) -> str:
    moved = _learners_movement(teaching, dance, name)
    return as_bvh(teaching.library.body, moved.quats, moved.hips_m, moved.fps)


class LessonPage(Page):
    """The lessons of one page, one after another: its messages (docs/teaching_development.md) go to a process, and the
    process's to it.
    """

    def __init__(self, socket: web.WebSocketResponse, teaching: Teaching, processes: LessonProcesses) -> None:
        super().__init__(socket)
        self._teaching, self._processes = teaching, processes
        self._process: LessonProcess | None = None
        self._members: list[dict] = []  # who danced beside the first learner

    async def follow(self, what: str, message: dict) -> None:
        if what == "prepare":
            await self._prepare(settings_from(Lesson, message.get("lesson"), "the lesson"))
        elif what == "stop":
            self.leave()
        elif what in ("go", "resume") and self._process is not None:
            in_s = check_fields(what, message, {"in_s": float})["in_s"]
            check_between("in_s", in_s, 0, 60)
            self._process.send(what, in_s)
        elif what == "pause" and self._process is not None:
            self._process.send("pause")
        elif what == "see" and self._process is not None:
            self._process.see(read_seen(message))
        else:
            raise InputError(UNKNOWN)

    async def _prepare(self, lesson: Lesson) -> None:
        if lesson.source not in self._teaching.sources:
            raise InputError("there is no such source of depth")
        if lesson.who:
            self._teaching.profiles.profile(lesson.who)
        dance = await asyncio.to_thread(self._teaching.library.dance, lesson.dance)
        lesson.excerpt_s(dance.about.seconds)
        if lesson.dancer >= len(dance.dancers):
            raise InputError(Said("there is no such dancer in this dance; reload the page"))
        if self._process is None or not self._process.alive:
            self.leave()
            self._process = self._processes.borrow()
            self.hear(self._process)
        else:
            self._process.send("stop")
        self._process.prepare(lesson, dance)

    def leave(self) -> None:
        self.hear(None)
        if self._process is not None:
            self._processes.give_back(self._process)
        self._process = None

    async def told(self, kind: str, content: dict, attached: Any) -> dict | None:
        if kind == "member":
            kept = await self._keep(content, attached)  # the first learner's try, which follows, says what goes wrong
            self._members.append({"session": kept.get("session"), "total": content["total"]})
            return None
        if kind == "done":
            content |= await self._keep(content | ({"members": self._members} if self._members else {}), attached)
        if kind in ("done", "preparing"):  # of a try that was left just before its end
            self._members = []
        return content

    async def _keep(self, result: dict, arrays: Any) -> dict:
        """Saves a try in which a person was seen; its name, or why it is not saved, for the page."""
        if result.get("total") is None:
            return {}
        try:
            return {"session": await asyncio.to_thread(self._teaching.profiles.keep, result, arrays)}
        except InputError as error:  # the profile was deleted meanwhile
            return {"not_saved": keyed(Said("this try was not saved: {reason}", reason=error.said))}
        except OSError as error:
            return {"not_saved": keyed(Said("this try could not be saved: {reason}", reason=error.strerror or str(error)))}
