"""The tracker: one person's joints, frame after frame, from depth alone.

Algorithm 2 alone follows slow movement and loses joints for good in fast ones. Here it gives one of a frame's
starting points; each is fitted as a body to the measured points, the one that explains the picture best stays, limbs
are laid anew where that explains it better, limbs that cross are tried the other way round, and a pose that explains it
badly makes the tracker look around: the body turned, bent or mirrored. Whether it faces the right way is looked at all along.
`TrackerConfig(body=False)` leaves all that away: the paper's tracker.

Nothing depends on time: equal input gives equal output.
"""

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.estimators import Estimator
from kpopnet.ridge import RidgeConfig, ridge_data
from kpopnet.skeleton import JOINT_NAMES, MIRROR, NUM_JOINTS
from kpopnet.tracker.body import TORSO_JOINTS, Body, body_of
from kpopnet.tracker.cells import FEWEST_CELLS, Cells, cells_of
from kpopnet.tracker.cones import frame_of
from kpopnet.tracker.fitted import SAID_WEIGHT
from kpopnet.tracker.fitting import fit
from kpopnet.tracker.hierarchy import HierarchyConfig, estimate_pose, lengths_of
from kpopnet.tracker.initial import InitialConfig, find_initial_pose
from kpopnet.tracker.misfit import misfit
from kpopnet.tracker.model import HumanModel
from kpopnet.tracker.proposals import bent, relay_limbs, turned, uncrossed
from kpopnet.tracker.standing import standing_pose
from kpopnet.tracker.surface import joint_confidence, with_thickness

SUDDENLY_LESS, FORGETTING = 0.7, 0.9
"""If less than this share of the cells last seen is left all at once, part of the picture is missing, not of the person:
the pose is held. What was seen is forgotten by this factor a frame, so that it is not held for ever."""

POINTS = 200
"""About so many points choose between poses; all of them fit the one chosen."""

FIRST_STEPS, MORE_STEPS, LAST_STEPS = 2, 3, 4
"""Every starting point is fitted with so few steps, the best of them with more, and the pose at last to all points."""

VELOCITY_SHARE = 0.5
FASTEST_M = 0.15
"""A joint is expected to go on with this share of its last step, which counts up to this length."""

STEP_WEIGHT = 0.01
FARTHEST_STEP_M = 0.25
"""A pose pays for the mean squared distance of its joints to where they were expected, each counted up to this."""

USUAL_M2, FORGETTING_USUAL = 4e-4, 0.02
DOUBT, ASK = 1.5, 1.0
"""A pose is in doubt from so many times a person's usual misfit on, and a detector is asked sooner; what is usual is learnt,
in this share a frame, from poses that are not in doubt, and begins with that many square metres."""

BETTER, MUCH_BETTER, MUCH_WORSE = 0.9, 0.8, 1.5
"""A pose close by must have less than this share of the misfit, one that is wholly different less than that: a back looks
much like a chest, and there is no turning round for little. A detector, which does not go by the misfit, is believed unless
its pose explains the picture worse than that."""

FRONT_EVERY, FRONT_STEPS, UPRIGHT = 5, 6, 0.5
"""Every so many frames the body turned round is fitted in so many steps, if the cosine between the torso and the camera's
vertical is at least the third: who stands on their hands carries head and knees otherwise."""

MOST_GAIN, ENOUGH_GAIN = 0.2, 0.3
"""In the logarithm of the misfit: one look counts up to the first, beyond the second the body is turned. Of 7,330 good poses of
training dances 99 in 100 explain the picture better than the body turned round by 0.05 or more, and 999 in 1,000 do not explain
it worse by more than 0.12."""

SLIGHTLY = tuple(lambda joints, angle=angle: turned(joints, angle) for angle in np.radians((-30, 30, -60, 60)))
THOROUGHLY = (
    lambda joints: joints[MIRROR],
    *(lambda joints, angle=angle: turned(joints, angle) for angle in np.radians((-90, 90, 135, -135, 180))),
    *(lambda joints, angle=angle: bent(joints, angle) for angle in np.radians((-40, 40))),
)

TORSO = np.array(TORSO_JOINTS)

AWAY_M = 0.3
"""If the silhouette's middle moved farther between two sightings, the pose is carried along."""


@dataclass(frozen=True)
class TrackerConfig:
    """Settings.

    Attributes:
        hierarchy: parameters of Algorithm 2.
        ridge: what counts as ridge data.
        body: fit a body, lay limbs anew, look around; without it only Algorithm 2 is run.
        search: look around when the pose explains the picture badly, and every now and then at the body turned round.
    """

    hierarchy: HierarchyConfig = field(default_factory=HierarchyConfig)
    ridge: RidgeConfig = field(default_factory=RidgeConfig)
    body: bool = True
    search: bool = True


class Tracker:
    """Follows one person. Give it frames in order; it waits for the Y pose unless it is told a pose to start from.

    Attributes:
        model: the person's lengths, None before the start; `HumanModel.save` keeps it for another day.
        body, lengths: the same as the kernels take it.
        joints_camera_m: (15, 3) the last pose, None before the start.
        velocity_m: (15, 3) the joints' last step.
    """

    def __init__(
        self,
        camera: Camera,
        config: TrackerConfig = TrackerConfig(),
        model: HumanModel | None = None,
        detector: Estimator | None = None,
        standing: bool = False,
    ) -> None:
        """Prepares a tracker.

        Args:
            camera: of the depth to come.
            config: settings.
            model: of a person who was seen before, instead of the one taken from the Y pose.
            standing: start with whoever stands upright, instead of waiting for the Y pose.
            detector: asked for the pose of a single frame when the tracker doubts its own, for instance a network.
        """
        self.camera = camera
        self.config = config
        self.model = model
        self.detector = detector
        self.standing = standing
        self.body: Body | None = None
        self.lengths: np.ndarray | None = None
        self.joints_camera_m: np.ndarray | None = None
        self.velocity_m = np.zeros((NUM_JOINTS, 3))
        self._middle: np.ndarray | None = None
        self._knows_thickness = False
        self._cells_seen = 0.0
        self._usual_m2 = USUAL_M2
        self._frames = 0
        self._other_side = 0.0

    @property
    def started(self) -> bool:
        """Whether there is a pose to go on from."""
        return self.joints_camera_m is not None

    def start(self, joints_camera_m: np.ndarray) -> None:
        """Starts from a known pose, of which the model is taken unless there is one.

        Raises:
            InputError: another shape, or joints are missing.
        """
        joints = np.asarray(joints_camera_m, np.float64)
        if joints.shape != (NUM_JOINTS, 3):
            raise InputError(f"tracker: expected ({NUM_JOINTS}, 3) joints to start from, found {joints.shape}")
        missing = [JOINT_NAMES[joint] for joint in np.flatnonzero(~np.isfinite(joints).all(axis=1))]
        if missing:
            raise InputError(f"tracker: expected joints without gaps to start from; missing: {', '.join(missing)}")
        if self.model is None:
            self.model = HumanModel.from_joints(joints)
        self._knows_thickness = False
        self.body, self.lengths = body_of(self.model), lengths_of(self.model)
        self.joints_camera_m, self.velocity_m, self._middle = joints, np.zeros_like(joints), None
        self._cells_seen, self._usual_m2, self._frames, self._other_side = 0.0, USUAL_M2, 0, 0.0

    def track(self, depth_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """One frame.

        Args:
            depth_m: (H, W) float32 metres of the person alone, 0 elsewhere.

        Returns:
            (15, 3) float64 joints in the camera frame in metres and (15,) confidence in 0..1; NaN and 0 before the start
            and while nobody is seen.
        """
        nothing = np.full((NUM_JOINTS, 3), np.nan), np.zeros(NUM_JOINTS)
        cells = cells_of(depth_m, self.camera)
        if len(cells.points_m) < FEWEST_CELLS or not (self.started or self._find_start(depth_m, cells)):
            return nothing
        if not self._knows_thickness:
            self.body, self._knows_thickness = with_thickness(self.body, self.joints_camera_m, cells), True
        if len(cells.points_m) < SUDDENLY_LESS * self._cells_seen:
            self._cells_seen *= FORGETTING
            self.velocity_m = np.zeros_like(self.velocity_m)
            return self.joints_camera_m.copy(), joint_confidence(self.joints_camera_m, cells, self.body)
        self._cells_seen = len(cells.points_m)
        before = self.joints_camera_m = self._carried(cells)
        if self.config.body:
            joints = self._follow(depth_m, cells)
            found = np.ones(NUM_JOINTS, bool)
        else:
            joints, support = self._algorithm_2(depth_m, cells)
            found = support > 0
        self.joints_camera_m, self.velocity_m = joints, (joints - before) * found[:, None]
        return joints.copy(), joint_confidence(joints, cells, self.body) * found

    def _find_start(self, depth_m: np.ndarray, cells: Cells) -> bool:
        """Starts if the frame shows a pose to start from."""
        if self.standing:
            found = standing_pose(cells)
            if found is not None:
                joints, model = found
                self.model = self.model or model
                self.start(joints)
        else:
            initial = find_initial_pose(depth_m, self.camera, InitialConfig(ridge=self.config.ridge))
            if initial is not None:
                model = HumanModel.from_joints(initial.joints_camera_m)
                self.model = self.model or (model.likely() if self.config.body else model)
                self.start(initial.joints_camera_m)
        if self.started and self.config.body:
            # Before the parts' thickness is taken of it: a figure that stands beside the person makes them too fat or thin.
            self.joints_camera_m = fit(self.joints_camera_m, cells, self.body, FIRST_STEPS + MORE_STEPS)
        return self.started

    def _carried(self, cells: Cells) -> np.ndarray:
        """The last pose, moved along if the person turns up elsewhere."""
        middle = cells.points_m.mean(axis=0)
        moved = np.zeros(3) if self._middle is None else middle - self._middle
        self._middle = middle
        return self.joints_camera_m + (moved if np.linalg.norm(moved) > AWAY_M else 0.0)

    def _algorithm_2(self, depth_m: np.ndarray, cells: Cells) -> tuple[np.ndarray, np.ndarray]:
        ridge = ridge_data(depth_m, self.config.ridge)
        return estimate_pose(
            ridge, cells, self.joints_camera_m, self.velocity_m, self.body, self.lengths, self.config.hierarchy
        )

    def _follow(self, depth_m: np.ndarray, cells: Cells) -> np.ndarray:
        before, body = self.joints_camera_m, self.body
        step = np.clip(self.velocity_m, -FASTEST_M, FASTEST_M)
        expected = before + VELOCITY_SHARE * step
        every = max(1, len(cells.points_m) // POINTS)

        def cost(joints: np.ndarray, every: int) -> float:
            return misfit(joints, cells, body, every) + STEP_WEIGHT * _way_m2(joints, expected)

        def best_fitted(starts: list[np.ndarray]) -> tuple[float, np.ndarray]:
            tried = [fit(start, cells, body, FIRST_STEPS, every) for start in starts]
            joints = fit(min(tried, key=lambda joints: cost(joints, every)), cells, body, MORE_STEPS, every)
            joints, _ = relay_limbs(joints, before, cells, body, every)
            joints = fit(joints, cells, body, LAST_STEPS)
            return cost(joints, 1), joints

        going_on = carried_on(before, self.velocity_m)
        starts = [expected, before, going_on, self._algorithm_2(depth_m, cells)[0], *uncrossed(before)]
        best, joints = best_fitted(starts)
        if best < DOUBT * self._usual_m2:
            self._usual_m2 += FORGETTING_USUAL * (best - self._usual_m2)
        if best > ASK * self._usual_m2 and (said := self._detected(depth_m)) is not None:
            said = fit(said, cells, body, LAST_STEPS, start_weight=SAID_WEIGHT)
            if misfit(said, cells, body) < MUCH_WORSE * misfit(joints, cells, body):
                self._other_side = 0.0
                return said
        for changes, better in ((SLIGHTLY, BETTER), (THOROUGHLY, MUCH_BETTER)):
            if self.config.search and best > DOUBT * self._usual_m2:
                alternative, found = best_fitted([change(joints) for change in changes])
                if alternative < better * best:
                    best, joints = alternative, found
                    self._other_side = 0.0
        return self._front_or_back(joints, cells) if self.config.search else joints

    def _front_or_back(self, joints: np.ndarray, cells: Cells) -> np.ndarray:
        """The pose, or the one seen from the other side if that has explained the picture better for a while.

        A cumulative sum (Page 1954) of what a body that faces the other way would explain better. It is about the pose that is
        followed: one that was found elsewhere, by looking around or by a detector, begins anew.
        """
        self._frames += 1
        if self._frames % FRONT_EVERY or frame_of(joints)[1, 1] < UPRIGHT:
            return joints
        other = fit(joints[MIRROR], cells, self.body, FRONT_STEPS)
        gain = np.log(misfit(joints, cells, self.body) / misfit(other, cells, self.body))
        self._other_side = max(self._other_side + min(gain, MOST_GAIN), 0.0)
        if self._other_side <= ENOUGH_GAIN:
            return joints
        self._other_side = 0.0
        return other

    def _detected(self, depth_m: np.ndarray) -> np.ndarray | None:
        """The detector's pose, if there is one and it has all joints."""
        if self.detector is None:
            return None
        joints = self.detector.estimate(depth_m[None], self.camera).joints_camera_m[0].astype(np.float64)
        return joints if np.isfinite(joints).all() else None


@njit(cache=True)
def _way_m2(joints, expected):
    """The mean squared distance of joints to where they were expected, each counted up to `FARTHEST_STEP_M`."""
    total = 0.0
    for j in range(len(joints)):
        away = 0.0
        for c in range(3):
            away += (joints[j, c] - expected[j, c]) ** 2
        total += min(away, FARTHEST_STEP_M**2)
    return total / len(joints)


@njit(cache=True)
def carried_on(joints_m, step_m):
    """(15, 3) the pose if the whole body moves on as the torso moved in its last step, turning with it."""
    last_m = joints_m - step_m
    now, last = frame_of(joints_m), frame_of(last_m)
    middle, last_middle = np.zeros(3), np.zeros(3)
    for joint in TORSO:
        middle += joints_m[joint] / len(TORSO)
        last_middle += last_m[joint] / len(TORSO)
    moved = np.empty_like(joints_m)
    for j in range(len(joints_m)):
        arm = joints_m[j] - middle
        turned_arm = np.zeros(3)
        for axis in range(3):
            turned_arm += (last[axis, 0] * arm[0] + last[axis, 1] * arm[1] + last[axis, 2] * arm[2]) * now[axis]
        moved[j] = 2 * middle - last_middle + turned_arm
    return moved
