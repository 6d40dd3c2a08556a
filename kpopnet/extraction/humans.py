"""Human extraction (section 2.1, Algorithm 1), picture after picture."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.errors import InputError
from kpopnet.extraction.components import LABEL, connect, label_image, survey
from kpopnet.extraction.floor import Floor, find_floor, refit_floor
from kpopnet.extraction.people import (
    OVERGROWN,
    Known,
    continue_people,
    fragments_beside,
    has_persons_size,
    near_somebody,
    returning,
)
from kpopnet.extraction.room import (
    FAR_M,
    FOREGROUND,
    NOBODY,
    NOTHING,
    ROOM,
    UNCOVERED,
    forget_human,
    is_picture,
    learn,
    sort_pixels,
)
from kpopnet.extraction.silhouettes import paint
from kpopnet.extraction.standing import find_standing

SAME_M = np.float32(0.1)
"""A body's surface moves less along the optical axis from one picture to the next."""

LEAST_PIXELS = 6
"""Smaller components are noise."""

MARGIN_PX = 2
"""Empty pixels around a human in their box: what the ridge needs."""

LOOK_FOR_FLOOR_EVERY = 30
UPRIGHT = np.array([0, -1, 0, 0], np.float32)
"""Stands for the floor where there is none: heights are above the camera then."""

STRANGE_SHARE, STRANGE_FRAMES = 0.1, 5
"""If so much of a picture is neither room nor human, it does not show this room (a camera that was knocked) and is passed
over; the last of so many in a row is the first of another room."""


@dataclass(frozen=True)
class HumanExtractionConfig:
    """Thresholds of Algorithm 1; the paper gives no numbers.

    Those on depth grow with its square, as the depth steps of a triangulating camera do (Kinect v1: z^2 / 345 m).

    Attributes:
        delta_f_m: what lies less above the floor is floor; the more so, the more its points scatter (`floor.Floor`).
        epsilon_z_m: neighbouring pixels whose depths differ by less belong to one object,
        epsilon_z_per_m2: plus so much times the square of the depth.
        epsilon_d_m: a pixel has moved if it lies in front of the known room by more (delta d of the paper),
        epsilon_d_per_m2: plus so much times the square of the depth.
        epsilon_m_m2: a component is moving if more of its surface has moved, in square metres. (The paper adds up the
            differences of depth, with which a step would count the more the farther the wall behind is.)
    """

    delta_f_m: float = 0.005
    epsilon_z_m: float = 0.03
    epsilon_z_per_m2: float = 1.5 / 345
    epsilon_d_m: float = 0.01
    epsilon_d_per_m2: float = 2 / 345
    epsilon_m_m2: float = 0.02

    def __post_init__(self) -> None:
        for name in ("delta_f_m", "epsilon_z_m", "epsilon_z_per_m2", "epsilon_d_m", "epsilon_d_per_m2", "epsilon_m_m2"):
            value = getattr(self, name)
            if not 0 <= value < math.inf:
                raise InputError(f"extraction.{name} must be a finite number from 0 on, not {value}")


@dataclass(frozen=True)
class Human:
    """One human in one picture.

    Attributes:
        identity: the same number for the same human in all pictures.
        box: x0, y0, x1, y1 in pixels, the last two exclusive; it leaves two empty pixels around the human, except at the
            picture's rim.
        depth_m: (y1 - y0, x1 - x0) float32 the human alone, 0 elsewhere.
        centre_m: (3,) float32 mean of the visible surface, camera frame.
    """

    identity: int
    box: tuple[int, int, int, int]
    depth_m: np.ndarray
    centre_m: np.ndarray

    def whole(self, camera: Camera) -> np.ndarray:
        """(H, W) float32 metres: the whole picture with nothing in it but this human."""
        x0, y0, x1, y1 = self.box
        depth_m = np.zeros((camera.height, camera.width), np.float32)
        depth_m[y0:y1, x0:x1] = self.depth_m
        return depth_m

    def cropped(self, camera: Camera) -> Camera:
        """The camera of `depth_m`, given that of the whole picture."""
        x0, y0, x1, y1 = self.box
        return camera.cropped(x0, y0, x1 - x0, y1 - y0)


class Picture(NamedTuple):
    """(H, W) images: float32 depth in metres, uint8 kind and owner of every pixel, see `room`."""

    depth: np.ndarray
    kind: np.ndarray
    owner: np.ndarray


class HumanExtractor:
    """Finds people in the pictures of a camera that stands still, online: every picture once, in order."""

    def __init__(
        self, camera: Camera, config: HumanExtractionConfig = HumanExtractionConfig(), expect_person: bool = False
    ) -> None:
        """Prepares an extractor.

        Args:
            camera: of the pictures to come.
            config: thresholds.
            expect_person: somebody is in view from the first picture on, and is found before they move: `standing`.
        """
        self.camera, self.config, self._expect_person = camera, config, expect_person
        self._intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
        self._epsilon_z = np.array([config.epsilon_z_m, config.epsilon_z_per_m2], np.float32)
        self._epsilon_d = np.array([config.epsilon_d_m, config.epsilon_d_per_m2], np.float32)
        self._shape = camera.height, camera.width
        self._now, self._before = (
            Picture(*(np.zeros(self._shape, dtype) for dtype in (np.float32, np.uint8, np.uint8))) for _ in range(2)
        )
        self._people: list[Known] = []
        self._identities = 0
        self._forget_room()

    def _forget_room(self) -> None:
        self._room = np.full(self._shape, FAR_M, np.float32)
        self._floor: Floor | None = None
        self._pictures = self._strange_ones = 0
        self._expecting = self._expect_person and not any(person.visible for person in self._people)

    @property
    def floor(self) -> np.ndarray | None:
        """(4,) unit normal n, upwards, and d with n.x + d = 0 on the floor, camera frame; None if it is not in view."""
        return None if self._floor is None else self._floor.plane.copy()

    def extract(self, depth_m: np.ndarray) -> list[Human]:
        """The people in the next picture.

        Args:
            depth_m: (H, W) float32 metres, 0 where nothing was measured; not changed and not kept.

        Returns:
            Who is seen, in the order in which they were found. Nobody before somebody has moved, unless a person is
            expected.

        Raises:
            InputError: not one depth image of the camera's size.
        """
        raw = self._checked(depth_m)
        if not is_picture(raw):
            return []
        self._remove_floor(raw)
        self._remove_room(raw)
        runs, pieces, votes = self._segment(self._now.kind, FOREGROUND)
        owners, present = continue_people(self._people, pieces, votes, self.config.epsilon_m_m2)
        if self._is_strange(pieces, owners):
            self._strange_ones += 1
            if self._strange_ones < STRANGE_FRAMES:
                return []
            self._forget_room()
            return self.extract(depth_m)
        runs, owners = self._welcome(runs, pieces, owners, present)
        silhouettes = self._identify(runs, owners)
        self._remember()
        humans = [
            self._human(number, person, silhouettes[number])
            for number, person in enumerate(self._people, 1)
            if person.visible
        ]
        self._now, self._before = self._before, self._now
        return humans

    def _checked(self, depth_m: np.ndarray) -> np.ndarray:
        if not (isinstance(depth_m, np.ndarray) and depth_m.dtype == np.float32 and depth_m.shape == self._shape):
            depth_m = depth_in_metres(depth_m, self.camera)
        if depth_m.ndim != 2:
            raise InputError(f"depth image: expected shape (H, W), got {depth_m.shape}; give one picture after the other")
        return np.ascontiguousarray(depth_m)

    def _remove_floor(self, raw: np.ndarray) -> None:
        """Fits the floor, and with it the plane above which heights are measured."""
        if self._floor is not None:
            self._floor = refit_floor(self._floor, raw, self.camera, self.config.delta_f_m)
        elif self._pictures % LOOK_FOR_FLOOR_EVERY == 0:
            self._floor = find_floor(raw, self.camera, self.config.delta_f_m)
        self._plane = UPRIGHT if self._floor is None else self._floor.plane.astype(np.float32)

    def _remove_room(self, raw: np.ndarray) -> None:
        delta_f = (0.0, 0.0) if self._floor is None else self._floor.delta_f(self.config.delta_f_m)
        sort_pixels(
            raw, self._room, self._plane, np.array(delta_f, np.float32), self._epsilon_d, self._intrinsics,
            self._now.depth, self._now.kind,
        )  # fmt: skip

    def _segment(self, kind: np.ndarray, kinds: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The components of pixels of these kinds: their runs, what they are like, and whom they continue."""
        depth = self._now.depth
        runs, count = connect(depth, kind, kinds, self._epsilon_z, LEAST_PIXELS)
        return runs, *survey(
            depth, kind, kinds, self._room, runs, count, self._plane, self._intrinsics, self._epsilon_z, self._before,
            len(self._people), SAME_M,
        )  # fmt: skip

    def _is_strange(self, pieces: np.ndarray, owners: np.ndarray) -> bool:
        """Whether much of the picture is neither known room nor anybody."""
        known = (owners != NOBODY) & (owners != OVERGROWN)
        unknown = np.count_nonzero(self._now.kind == FOREGROUND) - pieces["pixels"][known].sum()
        return self._pictures > 0 and unknown > STRANGE_SHARE * self._now.kind.size

    def _welcome(
        self, runs: np.ndarray, pieces: np.ndarray, owners: np.ndarray, present: dict[int, int]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Finds new people, and those who come back; returns the runs with theirs, and the owners by label."""
        moving = (owners == NOBODY) & (pieces["moved_m2"] > self.config.epsilon_m_m2) & (self._pictures > 0)
        if not (moving.any() or self._expecting):
            return runs, owners
        # All objects: what is nobody's yet, whether it is in front of the room or has been taken for room.
        taken = label_image(runs[owners[runs[:, LABEL]] != NOBODY], *self._shape) > 0
        object_runs, objects, _ = self._segment(np.where(taken, np.uint8(NOTHING), self._now.kind), ROOM | FOREGROUND)
        labels = label_image(object_runs, *self._shape)
        object_of = labels[pieces["first"][:, 0], pieces["first"][:, 1]]
        newcomers = {}  # numbers by object
        for label in np.flatnonzero(moving):
            # Of somebody who stood still only what has moved is in front of the room: they are the whole object.
            whole = object_of[label]
            if whole in newcomers:
                continue
            if has_persons_size(objects[whole]) and not near_somebody(pieces, label, present):
                number = newcomers[whole] = self._number(returning(self._people, present, objects[whole]), owners)
            elif has_persons_size(pieces[label]):
                number = owners[label] = self._number(returning(self._people, present, pieces[label]), owners)
            else:
                continue
            present[number] = label
        if self._expecting and not present:
            standing = find_standing(self._now.depth, self._now.kind, labels, objects, self._floor is not None)
            if standing is not None:
                number = newcomers[standing] = self._number(None, owners)
                self._people[number - 1].expected_at_m = objects[standing]["centre_m"].copy()
                present[number] = 0
        self._expecting &= not present
        if newcomers:
            theirs = {number: fragments_beside(objects, labels, whole) for whole, number in newcomers.items()}
            runs = runs[~np.any(list(theirs.values()), axis=0)[object_of[runs[:, LABEL]]]]
            for number, parts in theirs.items():
                forget_human(self._room, self._now.depth, parts[labels], self.camera.fx)
                added = object_runs[parts[object_runs[:, LABEL]]]
                added[:, LABEL] = len(owners)
                runs, owners = np.concatenate([runs, added]), np.append(owners, np.uint8(number))
        return runs, owners

    def _number(self, missing: int | None, owners: np.ndarray) -> int:
        """A newcomer's number: that of the missing one, if somebody is, or a new one.

        If somebody was only expected, and has not moved until now when somebody else does, the newcomer replaces them.
        """
        expected = next((k for k, person in enumerate(self._people, 1) if person.expected_at_m is not None), None)
        if missing and not expected:
            return missing
        person = Known(self._identities)
        self._identities += 1
        if expected:
            owners[owners == expected] = UNCOVERED
            self._people[expected - 1] = person
            return expected
        self._people.append(person)
        return len(self._people)

    def _identify(self, runs: np.ndarray, owners: np.ndarray) -> np.ndarray:
        """Says of each pixel whose it is; what is seen of each of the people, by number."""
        centres = np.full((len(self._people) + 1, 2), np.nan, np.float32)
        for number, person in enumerate(self._people, 1):
            if person.pixels:
                centres[number] = person.centre_m[::2]
        now = self._now
        silhouettes = paint(now.depth, runs, owners, centres, self._intrinsics, self._before, SAME_M, now.owner)
        for person, silhouette in zip(self._people, silhouettes[1:], strict=True):
            person.see(silhouette)
        return silhouettes

    def _remember(self) -> None:
        """Learns the room."""
        depth, kind, owner = self._now
        self._pictures += 1
        self._strange_ones = 0
        if self._pictures > 1:
            learn(depth, kind, owner, self._room, self._epsilon_d)
            return
        somebody = owner != NOBODY
        empty = (kind >= ROOM) & ~somebody
        self._room[empty] = depth[empty]
        if somebody.any():
            forget_human(self._room, depth, somebody, self.camera.fx)

    def _human(self, number: int, person: Known, silhouette: np.void) -> Human:
        x0, y0, x1, y1 = silhouette["box"].tolist()
        x0, y0 = max(x0 - MARGIN_PX, 0), max(y0 - MARGIN_PX, 0)
        x1, y1 = min(x1 + MARGIN_PX, self.camera.width), min(y1 + MARGIN_PX, self.camera.height)
        depth_m = _cut_out(self._now.depth, self._now.owner, number, x0, y0, x1, y1)
        return Human(person.identity, (x0, y0, x1, y1), depth_m, silhouette["centre_m"].copy())


@njit(cache=True)
def _cut_out(depth, owner, number, x0, y0, x1, y1):
    cut_out = np.empty((y1 - y0, x1 - x0), np.float32)
    for y in range(y0, y1):
        row, whose, out = depth[y], owner[y], cut_out[y - y0]
        for x in range(x0, x1):
            out[x - x0] = row[x] if whose[x] == number else np.float32(0)
    return cut_out
