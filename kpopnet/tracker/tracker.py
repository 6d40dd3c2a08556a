"""The body tracker: estimates one person's joints frame by frame from depth, by a body fitted to it.

Nothing depends on wall-clock time: equal input gives equal output.
"""

from typing import NamedTuple

import numpy as np

from kpopnet.camera import Camera, check_camera, check_metres
from kpopnet.errors import check_one_of
from kpopnet.estimator import FRAME_S, Estimator, complete_joints
from kpopnet.geometry.body import Body
from kpopnet.geometry.cones import torso_frame
from kpopnet.geometry.depth_grid import MIN_POINTS, DepthGrid, build_depth_grid
from kpopnet.geometry.human_model import HumanModel
from kpopnet.skeleton import MIRROR, NUM_JOINTS
from kpopnet.tracker.body_estimate import DETECTION_PRIOR_WEIGHT, BodyEstimate
from kpopnet.tracker.confidence import TRACKED_WEIGHTS, fit_score, probability, tracked_evidence
from kpopnet.tracker.fit import MAX_ASSOCIATION_M, fit, pose_cost
from kpopnet.tracker.limbs import refit_limbs, swap_crossed_limbs
from kpopnet.tracker.start import WAYS, find_start

VELOCITY_DAMPING, MAX_STEP_M = 0.5, 0.15
"""Expected pose = last pose + `VELOCITY_DAMPING` x last step, whose coordinates are clipped to `MAX_STEP_M` metres a frame."""

SUBSAMPLE_POINTS = 200
"""Approximate number of points with which poses are compared; the final fit uses all points. 400 find no more joints."""

START_ITERATIONS, PROPOSAL_ITERATIONS, REFINE_ITERATIONS, FINAL_ITERATIONS = 5, 2, 3, 4
"""Gauss-Newton iterations from a start pose that the tracker found, from every proposal, from the best one, and with all points
after the limbs."""

MOTION_WEIGHT, MAX_MOTION_M = 0.01, 0.25
"""Weight of the mean squared distance between joints and expected joints in the choice of a proposal, each distance clipped to
`MAX_MOTION_M` metres."""

DROPOUT_RATIO, DROPOUT_DECAY = 0.7, 0.9
"""Below this fraction of the visible area of the last frame the person is hidden in part, or the sensor fails: the pose is
held, else the body contracts into what is seen. The area shrinks by `DROPOUT_DECAY` in every held frame: nothing is held for
ever. Without it a person whose upper half drops out loses their pose (tests/kpopnet/tracker/test_tracker.py)."""

LOST_S = 0.99
"""When no image showed the person for longer, in seconds, as in thirty images at 30 a second, the tracker starts again when a
person comes. Where there was no image at all for longer, a start is a candidate beside the last pose, and no pose is held."""

SLOW_S = 0.08
"""Where images are farther apart, in seconds, a walking person leaves the reach of the fit: at 5 images a second a person who
walks away at 1 m/s was followed 14 cm behind."""

BASELINE_COST_M2, BASELINE_RATE, MAX_BASELINE_RATIO = 4e-4, 0.02, 1.5
"""What good poses of a person cost, square metres: the value at the start, and the weight of a frame in its exponential moving
average, to which frames below `MAX_BASELINE_RATIO` times the average contribute. Above the average a detector is queried."""

ACCEPT_DETECTED = 1.5
"""A detected pose, which does not know the cost, is accepted below this many times the cost of the tracked one."""

FLIP_STRIDE, FLIP_ITERATIONS, FLIP_UPRIGHT = 5, 6, 0.5
"""Every `FLIP_STRIDE` frames the pose is compared with the fitted mirrored body: front and back look alike. Only where the
cosine between the torso and the camera's vertical is at least `FLIP_UPRIGHT`: in a handstand head and knees are held
differently."""

FLIP_CLIP, FLIP_THRESHOLD = 0.2, 0.3
"""A comparison's log ratio of the costs counts at most `FLIP_CLIP`; the pose is mirrored where their cumulative sum (Page 1954)
is above `FLIP_THRESHOLD`. Of 7,330 good poses of training dances, 99 % have a log cost at least 0.05 below that of the mirrored
body, and 99.9 % at most 0.12 above."""


class State(NamedTuple):
    """What one frame leaves to the next."""

    joints_m: np.ndarray  # (15, 3) the pose in the camera frame
    middle_m: np.ndarray  # (3,) median of the points of the last frame that was not held
    step_m: np.ndarray  # (15, 3) how the joints moved from the frame before
    visible_m2: float = 0.0  # visible area of the last frame that was not held, square metres across the line of sight
    baseline_cost_m2: float = 0.0  # what good poses of this person cost, square metres
    flip_evidence: float = 0.0  # that front and back are confused, a cumulative sum of log cost ratios


class Tracker:
    """Tracks one person through consecutive frames; without a given start pose it finds one.

    Attributes:
        model: the person's lengths, None before the start unless given; `HumanModel.save` stores it for later recordings.
        state: what the last frame left, None before the start.
        evidence: (15, 3) `tracked_evidence` of the last pose, None before the start.
    """

    def __init__(
        self, camera: Camera, start: str = "auto", model: HumanModel | None = None, detector: Estimator | None = None
    ) -> None:
        """Prepares a tracker; `start` is a key of `kpopnet.tracker.start.WAYS`.

        The `model` of a known person is used instead of the one measured at the start. The `detector`, for instance a network,
        is queried for the pose of a single frame at the start (`start=auto`) and when the cost is high. Raises InputError for
        no camera, or another start.
        """
        check_camera(camera)
        check_one_of("start", start, WAYS)
        self.camera, self.ways, self.detector = camera, start, detector
        self.model = self._known_model = model
        self.state: State | None = None
        self.evidence: np.ndarray | None = None
        self._person = BodyEstimate()
        self._time_s: float | None = None
        self._missing_s = 0.0

    @property
    def started(self) -> bool:
        """Whether there is a pose to track from."""
        return self.state is not None

    @property
    def body(self) -> Body | None:
        """The person's body as round cones; None before the start."""
        return self._person.body

    def start(self, joints_camera_m: np.ndarray) -> None:
        """Starts from (15, 3) joints in the camera frame, metres; raises InputError for another shape, or missing joints."""
        joints_m = complete_joints(joints_camera_m, "tracker")
        self._start(joints_m, HumanModel.from_joints(joints_m))

    def _start(self, joints_m: np.ndarray, model: HumanModel) -> None:
        """Starts from (15, 3) joints with the person's lengths; a model that the tracker was given counts instead."""
        self.model = self._known_model or model
        self._person = BodyEstimate(self.model)
        self.state = State(joints_m, joints_m.mean(axis=0), np.zeros_like(joints_m), baseline_cost_m2=BASELINE_COST_M2)
        self._missing_s = 0.0

    def track(self, depth_m: np.ndarray, time_s: float | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Tracks the person in the next (H, W) float32 depth image, metres, 0 where the person is not.

        It was taken at `time_s`, in seconds of any clock; None: FRAME_S after the image before.

        (15, 3) float64 joints in the camera frame in metres and (15,) confidence, the estimated probability of an error below
        10 cm; NaN and 0 before the start and in frames without a visible person. Raises InputError as `check_metres`.
        """
        check_metres("tracker", self.camera, depth_m)
        grid, missing = build_depth_grid(depth_m, self.camera), (np.full((NUM_JOINTS, 3), np.nan), np.zeros(NUM_JOINTS))
        if len(grid.points_m) < MIN_POINTS:
            self.miss(time_s)
            return missing
        elapsed_s = self._elapsed_s(time_s)
        stalled = self._missing_s + elapsed_s > LOST_S and self.started
        self._missing_s = 0.0
        if not (self.started or self._find_start(depth_m, grid)):
            return missing
        if not self._person.frames:
            self._person.update(self.state.joints_m, grid)
        last = self.state
        if not stalled and _visible_m2(grid) < DROPOUT_RATIO * last.visible_m2:
            self.state = last._replace(step_m=np.zeros_like(last.step_m), visible_m2=DROPOUT_DECAY * last.visible_m2)
            return self._joints_and_confidence(grid)
        moved_m = np.median(grid.points_m, axis=0) - last.middle_m
        self.state = last._replace(middle_m=last.middle_m + moved_m)
        body, stride = self.body, max(1, len(grid.points_m) // SUBSAMPLE_POINTS)

        expected_m = last.joints_m + VELOCITY_DAMPING * np.clip(last.step_m, -MAX_STEP_M, MAX_STEP_M)
        candidates = [expected_m, last.joints_m, *swap_crossed_limbs(last.joints_m)]
        # The last pose is old, but a start alone finds fewer joints: few are upright (docs/ledger.md, A camera that stalls).
        if stalled and (found := find_start(depth_m, grid, self.camera, self.ways, self.detector)) is not None:
            candidates += [fit(one, grid, body, START_ITERATIONS) for one in (found[0], found[0][MIRROR])]
        if np.linalg.norm(moved_m) > MAX_ASSOCIATION_M or elapsed_s > SLOW_S:
            # Out of reach of the last pose: who was hidden comes back elsewhere, images are missing or far apart. A mask that
            # covers two people for a moment has another median too, but no pose explains it.
            there_m = fit(last.joints_m + moved_m, grid, body, FINAL_ITERATIONS)
            if pose_cost(there_m, grid, body, 1) < MAX_BASELINE_RATIO * last.baseline_cost_m2:
                candidates.append(there_m)
        fitted_m = _best_fit(candidates, expected_m, grid, body, stride)
        joints_m, _ = refit_limbs(fitted_m, last.joints_m, grid, body, stride)
        self.state = self._next_state(fit(joints_m, grid, body, FINAL_ITERATIONS), depth_m, grid)

        self._person.update(self.state.joints_m, grid)
        return self._joints_and_confidence(grid)

    def miss(self, time_s: float | None = None) -> None:
        """Goes on to the next frame, which does not show the person: as `track` with an empty image."""
        self._missing_s += self._elapsed_s(time_s)
        if self._missing_s > LOST_S and self.ways != "label":  # a start that was given is not found again
            self.state = None

    def _elapsed_s(self, time_s: float | None) -> float:
        """Seconds between the image before and the next one; FRAME_S where one's time is not known, 0 of a clock put back."""
        before_s, self._time_s = self._time_s, time_s
        return FRAME_S if before_s is None or time_s is None else max(time_s - before_s, 0.0)

    def _joints_and_confidence(self, grid: DepthGrid) -> tuple[np.ndarray, np.ndarray]:
        """(15, 3) joints of the last pose and (15,) confidence."""
        self.evidence = tracked_evidence(fit_score(self.state.joints_m, grid, self.body))
        return self.state.joints_m.copy(), probability(self.evidence, TRACKED_WEIGHTS)

    def _find_start(self, depth_m: np.ndarray, grid: DepthGrid) -> bool:
        """Starts if the frame shows a pose to start from; returns whether the tracker has started."""
        found = find_start(depth_m, grid, self.camera, self.ways, self.detector)
        if found is not None:
            self._start(*found)
            # Fit before measuring the thickness: a displaced pose would give too thick or too thin parts.
            self.state = self.state._replace(joints_m=fit(found[0], grid, self.body, START_ITERATIONS))
        return self.started

    def _next_state(self, joints_m: np.ndarray, depth_m: np.ndarray, grid: DepthGrid) -> State:
        """The state with these fitted joints, or with a detected or a mirrored pose if that explains the depth better."""
        last, cost_m2 = self.state, pose_cost(joints_m, grid, self.body, 1)
        baseline_m2, evidence = last.baseline_cost_m2, last.flip_evidence
        if cost_m2 < MAX_BASELINE_RATIO * baseline_m2:
            baseline_m2 += BASELINE_RATE * (cost_m2 - baseline_m2)
        detected_m = None
        if self.detector is not None and cost_m2 > baseline_m2:
            found_m = self.detector.estimate(depth_m[None], self.camera).joints_camera_m[0]
            if np.isfinite(found_m).all():
                detected_m = fit(found_m, grid, self.body, FINAL_ITERATIONS, prior_weight=DETECTION_PRIOR_WEIGHT)
        if detected_m is not None and pose_cost(detected_m, grid, self.body, 1) < ACCEPT_DETECTED * cost_m2:
            joints_m, evidence = detected_m, 0.0
        elif self._person.frames % FLIP_STRIDE == 0 and torso_frame(joints_m)[1, 1] >= FLIP_UPRIGHT:
            mirrored_m = fit(joints_m[MIRROR], grid, self.body, FLIP_ITERATIONS)
            gain = np.log(cost_m2 / pose_cost(mirrored_m, grid, self.body, 1))
            evidence = max(evidence + min(gain, FLIP_CLIP), 0.0)
            if evidence > FLIP_THRESHOLD:
                joints_m, evidence = mirrored_m, 0.0
        return State(joints_m, last.middle_m, joints_m - last.joints_m, _visible_m2(grid), baseline_m2, evidence)


def _visible_m2(grid: DepthGrid) -> float:
    fx, fy, _, _, cell_px = grid.intrinsics
    return float((grid.points_m[:, 2] ** 2).sum()) * cell_px**2 / (fx * fy)


def _best_fit(candidates: list[np.ndarray], expected_m: np.ndarray, grid: DepthGrid, body: Body, stride: int) -> np.ndarray:
    """(15, 3) joints fitted from the best of several (15, 3) poses, with every `stride`th point."""

    def cost_m2(joints_m: np.ndarray) -> float:
        motion_m2 = np.minimum(((joints_m - expected_m) ** 2).sum(axis=1), MAX_MOTION_M**2).mean()
        return pose_cost(joints_m, grid, body, stride) + MOTION_WEIGHT * motion_m2

    proposals = [fit(one, grid, body, PROPOSAL_ITERATIONS, stride) for one in candidates]
    return fit(min(proposals, key=cost_m2), grid, body, REFINE_ITERATIONS, stride)
