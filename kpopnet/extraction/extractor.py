"""Human extraction (section 2.1, Algorithm 1), one image at a time."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kpopnet.camera import Camera, depth_in_metres
from kpopnet.errors import InputError
from kpopnet.extraction.assignment import assign_pixels
from kpopnet.extraction.association import (
    PERSON_AND_OBJECT,
    Track,
    associate_components,
    is_near_person,
    is_person_sized,
    nearest_missing,
    with_fragments,
)
from kpopnet.extraction.background import (
    BACKGROUND,
    FAR_M,
    FOREGROUND,
    NO_PERSON,
    UNCOVERED,
    UNMEASURED,
    classify_pixels,
    is_depth_image,
    remove_person,
    update_background,
)
from kpopnet.extraction.components import LABEL, component_stats, label_image, label_runs
from kpopnet.extraction.floor import Floor, find_floor, refit_floor
from kpopnet.extraction.stationary import find_stationary_person, stands_out
from kpopnet.human import Human

MAX_STEP_M = np.float32(0.1)
"""A body's surface moves less than this along the optical axis from one image to the next."""

MIN_COMPONENT_PX = 6
"""Smaller components are noise."""

SAME_PLACE_M = 0.3
"""A person found standing, whose track a moving person replaced, gets the identity back within this distance, in metres."""

FLOOR_SEARCH_INTERVAL = 30
"""Images from one search for the floor to the next, while no floor is known."""

LEVEL_PLANE = np.array([0, -1, 0, 0], np.float32)
"""Replaces the floor plane where there is none: heights are relative to the camera."""

MAX_UNEXPLAINED_SHARE, MAX_UNEXPLAINED_FRAMES = 0.1, 5
"""An image with a larger share of foreground that belongs to no person does not fit the background (a camera that was
knocked). It is skipped. After this many such images in a row, the last one starts a new background."""


@dataclass(frozen=True)
class HumanExtractionConfig:
    """Thresholds of Algorithm 1; the paper gives no numbers.

    Those on depth grow with its square, as the depth steps of a triangulating camera do (Kinect v1: z^2 / 345 m).

    Attributes:
        delta_f_m: pixels less than this above the floor are floor, in metres; the scatter of the floor's points is added
            (`floor.Floor`).
        epsilon_z_m: neighbouring pixels belong to one object if their depths differ by less than this, in metres.
        epsilon_z_per_m2: increase of epsilon_z_m per square metre of squared depth.
        epsilon_d_m: a pixel has moved if it is in front of the background by more than this, in metres (delta d of the
            paper).
        epsilon_d_per_m2: increase of epsilon_d_m per square metre of squared depth.
        epsilon_m_m2: a component is moving if more than this area of its surface has moved, in square metres. (The paper
            sums differences of depth, so a step would count more the farther away the wall behind is.)
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
                raise InputError(f"extraction.{name} must be a finite number of at least 0, not {value}")


class Frame(NamedTuple):
    """(H, W) images: float32 depth in metres, uint8 kind and owner of every pixel, see `background`."""

    depth: np.ndarray
    kind: np.ndarray
    owner: np.ndarray


class HumanExtractor:
    """Finds and tracks people in the depth images of a static camera, online: each image once, in order."""

    def __init__(
        self, camera: Camera, config: HumanExtractionConfig = HumanExtractionConfig(), expect_person: bool = False
    ) -> None:
        """Prepares an extractor.

        Args:
            camera: the camera of all images.
            config: thresholds.
            expect_person: a person is in view from the first image on, and is found before they move (`stationary`).
        """
        self.camera, self.config, self._expect_person = camera, config, expect_person
        self._intrinsics = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
        self._epsilon_z = np.array([config.epsilon_z_m, config.epsilon_z_per_m2], np.float32)
        self._epsilon_d = np.array([config.epsilon_d_m, config.epsilon_d_per_m2], np.float32)
        self._shape = camera.height, camera.width
        self._now, self._before = (
            Frame(*(np.zeros(self._shape, dtype) for dtype in (np.float32, np.uint8, np.uint8))) for _ in range(2)
        )
        self._tracks: list[Track] = []
        self._num_identities = 0
        self._reset_background()

    def _reset_background(self) -> None:
        self._background = np.full(self._shape, FAR_M, np.float32)
        self._floor: Floor | None = None
        self._num_images = self._num_unexplained = 0
        self._replaced: Track | None = None
        self._expecting = self._expect_person and not any(track.visible for track in self._tracks)

    @property
    def floor(self) -> np.ndarray | None:
        """(4,) unit normal n, upwards, and d with n.x + d = 0 on the floor, camera frame, metres; None if not in view."""
        return None if self._floor is None else self._floor.plane.copy()

    def extract(self, depth_m: np.ndarray) -> list[Human]:
        """The people in the next image.

        Args:
            depth_m: (H, W) float32 metres, 0 where nothing was measured; neither changed nor kept.

        Returns:
            The visible people, in the order in which they were first found. The list is empty until a person has moved,
            unless a person is expected.

        Raises:
            InputError: not one depth image of the camera's size.
        """
        raw = self._checked(depth_m)
        if not is_depth_image(raw):
            return []
        self._update_floor(raw)
        self._classify(raw)
        runs, components, votes = self._segment(self._now.kind, FOREGROUND)
        owners, present = associate_components(self._tracks, components, votes, self.config.epsilon_m_m2)
        if self._is_unexplained(components, owners):
            self._num_unexplained += 1
            if self._num_unexplained < MAX_UNEXPLAINED_FRAMES:
                return []
            self._reset_background()
            return self.extract(depth_m)
        runs, owners = self._add_people(runs, components, owners, present)
        silhouettes = self._update_tracks(runs, owners)
        self._update_background()
        humans = [
            self._human(number, track, silhouettes[number]) for number, track in enumerate(self._tracks, 1) if track.visible
        ]
        self._now, self._before = self._before, self._now
        return humans

    def _checked(self, depth_m: np.ndarray) -> np.ndarray:
        if not (isinstance(depth_m, np.ndarray) and depth_m.dtype == np.float32 and depth_m.shape == self._shape):
            depth_m = depth_in_metres(depth_m, self.camera)
        if depth_m.ndim != 2:
            raise InputError(f"depth image: expected shape (H, W), got {depth_m.shape}; pass one image per call")
        return np.ascontiguousarray(depth_m)

    def _update_floor(self, raw: np.ndarray) -> None:
        """Fits the floor, and with it the plane above which heights are measured."""
        if self._floor is not None:
            self._floor = refit_floor(self._floor, raw, self.camera, self.config.delta_f_m)
        elif self._num_images % FLOOR_SEARCH_INTERVAL == 0:
            self._floor = find_floor(raw, self.camera, self.config.delta_f_m)
        self._plane = LEVEL_PLANE if self._floor is None else self._floor.plane.astype(np.float32)

    def _classify(self, raw: np.ndarray) -> None:
        """Sets the kind of every pixel of the current frame."""
        delta_f = (0.0, 0.0) if self._floor is None else self._floor.delta_f(self.config.delta_f_m)
        classify_pixels(
            raw, self._background, self._plane, np.array(delta_f, np.float32), self._epsilon_d, self._intrinsics,
            self._now.depth, self._now.kind,
        )  # fmt: skip

    def _segment(self, kind: np.ndarray, kinds: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The components of pixels of these kinds: their runs, their statistics, and their votes for tracked people."""
        depth = self._now.depth
        runs, count = label_runs(depth, kind, kinds, self._epsilon_z, MIN_COMPONENT_PX)
        return runs, *component_stats(
            depth, kind, kinds, self._background, runs, count, self._plane, self._intrinsics, self._epsilon_z, self._before,
            len(self._tracks), MAX_STEP_M,
        )  # fmt: skip

    def _is_unexplained(self, components: np.ndarray, owners: np.ndarray) -> bool:
        """Whether too much of the image is foreground that belongs to no person."""
        explained = (owners != NO_PERSON) & (owners != PERSON_AND_OBJECT)
        unexplained = np.count_nonzero(self._now.kind == FOREGROUND) - components["pixels"][explained].sum()
        return self._num_images > 0 and unexplained > MAX_UNEXPLAINED_SHARE * self._now.kind.size

    def _add_people(
        self, runs: np.ndarray, components: np.ndarray, owners: np.ndarray, present: dict[int, int]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Finds new and returning people; returns the runs including theirs, and the owners by label."""
        moving = (owners == NO_PERSON) & (components["moved_m2"] > self.config.epsilon_m_m2) & (self._num_images > 0)
        if not (moving.any() or self._expecting):
            return runs, owners
        # Objects consist of all pixels without an owner, in the foreground or learned into the background.
        owned = label_image(runs[owners[runs[:, LABEL]] != NO_PERSON], *self._shape) > 0
        unowned_kind = np.where(owned, np.uint8(UNMEASURED), self._now.kind)
        object_runs, objects, _ = self._segment(unowned_kind, BACKGROUND | FOREGROUND)
        labels = label_image(object_runs, *self._shape)
        object_of = labels[components["first"][:, 0], components["first"][:, 1]]
        newcomers = {}  # person number by object label
        for label in np.flatnonzero(moving):
            # Only the moving part of a person who stood still is foreground: the whole object is the person.
            whole = object_of[label]
            if whole in newcomers:
                continue
            alone = is_person_sized(objects[whole]) and not is_near_person(components, label, present)
            newcomer = objects[whole] if alone else components[label]
            if not is_person_sized(newcomer) or (alone and present and not stands_out(*self._now[:2], labels, whole)):
                continue
            number = self._assign_number(newcomer, nearest_missing(self._tracks, present, newcomer), owners)
            if alone:
                newcomers[whole] = number
            else:
                owners[label] = number
            present[number] = label
        if self._expecting and not present:
            standing = find_stationary_person(self._now.depth, self._now.kind, labels, objects, self._floor is not None)
            if standing is not None:
                number = newcomers[standing] = self._assign_number(objects[standing], None, owners)
                self._tracks[number - 1].expected_at_m = objects[standing]["centre_m"].copy()
                present[number] = 0
        self._expecting &= not present
        if newcomers:
            parts_of = {number: with_fragments(objects, labels, whole) for whole, number in newcomers.items()}
            runs = runs[~np.any(list(parts_of.values()), axis=0)[object_of[runs[:, LABEL]]]]
            for number, parts in parts_of.items():
                remove_person(self._background, self._now.depth, parts[labels], self.camera.fx)
                added = object_runs[parts[object_runs[:, LABEL]]]
                added[:, LABEL] = len(owners)
                runs, owners = np.concatenate([runs, added]), np.append(owners, np.uint8(number))
        return runs, owners

    def _assign_number(self, newcomer: np.void, missing: int | None, owners: np.ndarray) -> int:
        """The number of a new human, a COMPONENT: that of the given missing person, or a new one.

        If `stationary` found a person who has not moved yet, the new human replaces that person, whose components in
        `owners` become background.
        """
        expected = next((k for k, track in enumerate(self._tracks, 1) if track.expected_at_m is not None), None)
        if missing and not expected:
            return missing
        track = Track(self._identity_of(newcomer))
        if expected:
            owners[owners == expected] = UNCOVERED
            self._replaced, self._tracks[expected - 1] = self._tracks[expected - 1], track
            return expected
        self._tracks.append(track)
        return len(self._tracks)

    def _identity_of(self, newcomer: np.void) -> int:
        """A new identity; but that of the person found standing whom another replaced, if the newcomer is in that place."""
        replaced = self._replaced
        if replaced is not None and np.linalg.norm(replaced.centre_m - newcomer["centre_m"]) < SAME_PLACE_M:
            self._replaced = None
            return replaced.identity
        self._num_identities += 1
        return self._num_identities - 1

    def _update_tracks(self, runs: np.ndarray, owners: np.ndarray) -> np.ndarray:
        """Assigns every pixel to a person and updates the tracks; returns the silhouettes by person number."""
        centres = np.full((len(self._tracks) + 1, 2), np.nan, np.float32)
        for number, track in enumerate(self._tracks, 1):
            if track.pixels:
                centres[number] = track.centre_m[::2]
        now = self._now
        silhouettes = assign_pixels(now.depth, runs, owners, centres, self._intrinsics, self._before, MAX_STEP_M, now.owner)
        for track, silhouette in zip(self._tracks, silhouettes[1:], strict=True):
            track.update(silhouette)
        return silhouettes

    def _update_background(self) -> None:
        """Updates the background; the first image initialises it."""
        depth, kind, owner = self._now
        self._num_images += 1
        self._num_unexplained = 0
        if self._num_images > 1:
            update_background(depth, kind, owner, self._background, self._epsilon_d)
            return
        person = owner != NO_PERSON
        empty = (kind >= BACKGROUND) & ~person
        self._background[empty] = depth[empty]
        if person.any():
            remove_person(self._background, depth, person, self.camera.fx)

    def _human(self, number: int, track: Track, silhouette: np.void) -> Human:
        box, centre_m = silhouette["box"], silhouette["centre_m"]
        return Human.cut_out(track.identity, self._now.depth, self._now.owner, number, box, centre_m)
