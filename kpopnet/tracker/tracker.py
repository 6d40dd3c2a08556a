"""The tracker: estimates one person's joints frame by frame from depth.

Algorithm 2 alone tracks slow motion and loses joints permanently in fast motion. Here its pose is one of several proposals
per frame:

1. A body is fitted to the measured points from each proposal. Poses with exchanged limbs are proposals where limbs cross.
2. The fit with the lowest cost is kept. Its limbs are refitted where that lowers the cost.
3. If the cost is high, a detector is queried, and local and global perturbations of the pose are tried: rotated, bent or
   mirrored bodies.
4. At regular intervals the mirrored body is compared with the pose, to detect a flip of front and back.

`TrackerConfig(body=False)` leaves all this out: the paper's tracker.

Nothing depends on wall-clock time: equal input gives equal output.
"""

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from kpopnet.camera import Camera
from kpopnet.errors import InputError
from kpopnet.estimator import Estimator
from kpopnet.geometry.body import TORSO_JOINTS, Body, body_from_model
from kpopnet.geometry.cones import torso_frame
from kpopnet.geometry.depth_grid import MIN_POINTS, DepthGrid, build_depth_grid
from kpopnet.geometry.human_model import HumanModel
from kpopnet.paper_tracker.algorithm2 import HierarchyConfig, estimate_pose, model_lengths
from kpopnet.ridge import RidgeConfig, ridge_data
from kpopnet.skeleton import JOINT_NAMES, MIRROR, NUM_JOINTS
from kpopnet.tracker.fit.confidence import ALGORITHM_2_WEIGHTS, TRACKED_WEIGHTS, fit_score, probability, tracked_evidence
from kpopnet.tracker.fit.hypotheses import refit_limbs, rotate_about_shoulders, rotate_about_spine, swap_crossed_limbs
from kpopnet.tracker.fit.objective import pose_cost
from kpopnet.tracker.fit.refine import DETECTION_PRIOR_WEIGHT
from kpopnet.tracker.fit.solver import fit
from kpopnet.tracker.lengths import RunningLengths
from kpopnet.tracker.start.finding import find_start

DROPOUT_RATIO, VISIBLE_DECAY = 0.7, 0.9
"""Visible points fell below 70 % of the last accepted frame: sensor dropout; hold the pose. The reference count decays by
`VISIBLE_DECAY` per held frame, so that the pose is not held forever."""

SUBSAMPLE_POINTS = 200
"""Approximate number of points with which poses are compared; the final fit uses all points."""

PROPOSAL_ITERATIONS, REFINE_ITERATIONS, FINAL_ITERATIONS = 2, 3, 4
"""Gauss-Newton iterations for every proposal, for the best proposal, and for the final fit to all points."""

VELOCITY_DAMPING = 0.5
MAX_STEP_M = 0.15
"""Expected pose = last pose + `VELOCITY_DAMPING` x last step; each coordinate of the step is clipped to `MAX_STEP_M` metres per
frame."""

MOTION_PRIOR_WEIGHT = 0.01
MAX_PRIOR_DISTANCE_M = 0.25
"""Motion prior: weight of the mean squared distance between joints and expected joints, each distance clipped to
`MAX_PRIOR_DISTANCE_M` metres."""

BASELINE_COST_M2, BASELINE_RATE = 4e-4, 0.02
SEARCH_RATIO, DETECTOR_RATIO = 1.5, 1.0
"""Perturbed poses are tried above `SEARCH_RATIO` times the person's baseline cost, a detector is queried above
`DETECTOR_RATIO` times. The baseline starts at `BASELINE_COST_M2` square metres; poses below the search ratio update it as
an exponential moving average with `BASELINE_RATE` per frame."""

LOCAL_ACCEPT, GLOBAL_ACCEPT, DETECTOR_REJECT_RATIO = 0.9, 0.8, 1.5
"""Accept local perturbations below 0.9 of the current cost, global ones below 0.8 (front and back look alike). A detector does
not use the cost; its pose is accepted below 1.5 times the current cost."""

FLIP_TEST_INTERVAL, FLIP_TEST_ITERATIONS, MIN_UPRIGHT_COSINE = 5, 6, 0.5
"""Every `FLIP_TEST_INTERVAL` frames the mirrored body is fitted with `FLIP_TEST_ITERATIONS` iterations, if the cosine between
the torso and the camera's vertical is at least `MIN_UPRIGHT_COSINE`: in a handstand head and knees are held differently."""

CUSUM_CLIP, CUSUM_THRESHOLD = 0.2, 0.3
"""CUSUM of the log cost ratio of pose and mirrored pose; increments clipped at 0.2; flip above 0.3 (Page 1954). Of 7,330 good
poses of training dances, 99 % have a log cost at least 0.05 below that of the mirrored body, and 99.9 % at most 0.12 above."""

LOCAL_PERTURBATIONS = tuple(
    lambda joints, angle=angle: rotate_about_spine(joints, angle) for angle in np.radians((-30, 30, -60, 60))
)
"""Rotations about the torso's long axis by 30 and 60 degrees."""
GLOBAL_PERTURBATIONS = (
    lambda joints: joints[MIRROR],
    *(lambda joints, angle=angle: rotate_about_spine(joints, angle) for angle in np.radians((-90, 90, 135, -135, 180))),
    *(lambda joints, angle=angle: rotate_about_shoulders(joints, angle) for angle in np.radians((-40, 40))),
)
"""Left and right exchanged, rotations about the torso's long axis by 90 degrees and more, rotations about the shoulder line."""

TORSO = np.array(TORSO_JOINTS)

LOST_FRAMES = 30
"""After so many frames without the person, the tracker starts anew with whoever comes."""

HOPELESS_COST_M2, HOPELESS_FRAMES, RESTART_RATIO = 2e-3, 30, 0.6
"""After `HOPELESS_FRAMES` frames in a row with a cost above `HOPELESS_COST_M2` square metres, a start is looked for again, and
every as many frames; it is taken below `RESTART_RATIO` times the cost."""

RELOCATION_M = 0.3
"""If the centroid of the points moved farther between two frames, in metres, the last pose is translated with it."""


@dataclass(frozen=True)
class TrackerConfig:
    """Settings of the tracker.

    Attributes:
        hierarchy: parameters of Algorithm 2.
        ridge: parameters of the ridge data.
        body: fit a body, refit limbs and search; false runs Algorithm 2 alone.
        start: auto (the Y pose, else a network's joints where `network` names one, else anybody who stands or sits upright),
            y_pose (waits for the paper's start pose), standing (whoever stands upright), or label (the benchmark's true joints
            in the first frame that has all of them).
        lengths: estimate the person's lengths and thickness over the frames, instead of keeping those of the start.
        search: try perturbed poses where the pose cost is high, and the mirrored body at regular intervals.
    """

    hierarchy: HierarchyConfig = field(default_factory=HierarchyConfig)
    ridge: RidgeConfig = field(default_factory=RidgeConfig)
    body: bool = True
    start: str = "auto"
    lengths: bool = True
    search: bool = True


class Tracker:
    """Tracks one person through consecutive frames. Without a given start pose it finds one (`TrackerConfig.start`).

    Attributes:
        model: the person's lengths, None before the start; `HumanModel.save` stores it for later recordings.
        body: the model as round cones, for the kernels of the fit; None before the start.
        lengths: (2, 15) the model's lengths for the kernels of Algorithm 2, metres; None before the start.
        joints_camera_m: (15, 3) the last pose in the camera frame, None before the start.
        velocity_m: (15, 3) the joints' last step, metres per frame.
        evidence: (15, 3) what the confidence of the last pose was computed from (kpopnet.tracker.fit.confidence), None before
            the start.
    """

    def __init__(
        self,
        camera: Camera,
        config: TrackerConfig = TrackerConfig(),
        model: HumanModel | None = None,
        detector: Estimator | None = None,
    ) -> None:
        """Prepares a tracker.

        Args:
            camera: the camera of the depth images.
            config: settings.
            model: the model of a known person, used instead of the one measured at the start.
            detector: an estimator that is queried for the pose of a single frame when the cost is high, for instance a network.
        """
        self.camera = camera
        self.config = config
        self.model = model
        self.detector = detector
        self._known_model = model
        self._person: RunningLengths | None = None
        self._has_begun = False
        self._empty_frames = self._hopeless_frames = 0
        self.body: Body | None = None
        self.lengths: np.ndarray | None = None
        self.joints_camera_m: np.ndarray | None = None
        self.velocity_m = np.zeros((NUM_JOINTS, 3))
        self.evidence: np.ndarray | None = None
        self._centroid: np.ndarray | None = None
        self._visible_points = 0.0
        self._baseline_cost_m2 = BASELINE_COST_M2
        self._frames = 0
        self._flip_evidence = 0.0

    @property
    def started(self) -> bool:
        """Whether there is a pose to track from."""
        return self.joints_camera_m is not None

    def start(self, joints_camera_m: np.ndarray, model: HumanModel | None = None, size_deviation: float | None = None) -> None:
        """Starts from a known pose.

        Args:
            joints_camera_m: (15, 3) joints in the camera frame in metres.
            model: the person's lengths, by default those of this pose. A model that the tracker was given counts instead.
            size_deviation: standard deviation of the error of the lengths' common scale, as a fraction; by default the lengths
                are known, and stay.

        Raises:
            InputError: another shape, or joints are missing.
        """
        joints = np.asarray(joints_camera_m, np.float64)
        if joints.shape != (NUM_JOINTS, 3):
            raise InputError(f"tracker: expected ({NUM_JOINTS}, 3) joints to start from, found {joints.shape}")
        missing = [JOINT_NAMES[joint] for joint in np.flatnonzero(~np.isfinite(joints).all(axis=1))]
        if missing:
            raise InputError(f"tracker: expected a start pose with all joints; missing: {', '.join(missing)}")
        learned = self.config.body and self.config.lengths and self._known_model is None
        self.model = self._known_model or model or HumanModel.from_joints(joints)
        self._person = RunningLengths(self.model, size_deviation if learned else None)
        self._has_begun = False
        self.body, self.lengths = self._person.body, model_lengths(self.model)
        self.joints_camera_m, self.velocity_m, self._centroid = joints, np.zeros_like(joints), None
        self._visible_points, self._baseline_cost_m2, self._frames, self._flip_evidence = 0.0, BASELINE_COST_M2, 0, 0.0

    def track(self, depth_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tracks the person in the next frame.

        Args:
            depth_m: (H, W) float32 metres of the person, 0 elsewhere.

        Returns:
            (15, 3) float64 joints in the camera frame in metres and (15,) confidence, the estimated probability of an error
            below 10 cm; NaN and 0 before the start and in frames without a visible person.
        """
        missing = np.full((NUM_JOINTS, 3), np.nan), np.zeros(NUM_JOINTS)
        grid = build_depth_grid(depth_m, self.camera)
        self._forget_the_lost(len(grid.points_m) >= MIN_POINTS)
        if len(grid.points_m) < MIN_POINTS or not (self.started or self._find_start(depth_m, grid)):
            return missing
        if not self._has_begun:
            self._begin(grid)
        if len(grid.points_m) < DROPOUT_RATIO * self._visible_points:
            self._visible_points *= VISIBLE_DECAY
            self.velocity_m = np.zeros_like(self.velocity_m)
            return self.joints_camera_m.copy(), self._confidence(grid, np.ones(NUM_JOINTS, bool))
        self._visible_points = len(grid.points_m)
        previous = self.joints_camera_m = self._relocated_pose(grid)
        if self.config.body:
            joints = self._track_body(depth_m, grid)
            self._person.update(joints, grid, _stride(grid))
            self._adopt_body()
            joints = self._restarted_if_hopeless(joints, depth_m, grid)
            supported = np.ones(NUM_JOINTS, bool)
        else:
            joints, support = self._algorithm_2(depth_m, grid)
            supported = support > 0
        self.joints_camera_m, self.velocity_m = joints, (joints - previous) * supported[:, None]
        return joints.copy(), self._confidence(grid, supported)

    def _confidence(self, grid: DepthGrid, supported: np.ndarray) -> np.ndarray:
        """(15,) confidence of the last pose, of whose joints those that are (15,) `supported` were found in the depth."""
        self.evidence = tracked_evidence(fit_score(self.joints_camera_m, grid, self.body) * supported)
        return probability(self.evidence, TRACKED_WEIGHTS if self.config.body else ALGORITHM_2_WEIGHTS)

    def _find_start(self, depth_m: np.ndarray, grid: DepthGrid) -> bool:
        """Starts if the frame shows a pose to start from; returns whether the tracker has started."""
        found = find_start(depth_m, grid, self.camera, self.config.start, self.config.ridge, self.detector)
        if found is None:
            return False
        model = found.model if self.config.body else HumanModel.from_joints(found.joints_camera_m)
        self.start(found.joints_camera_m, model, found.size_deviation)
        if self.config.body:
            # Fit before measuring the thickness: a displaced pose would give too thick or too thin parts.
            self.joints_camera_m = fit(self.joints_camera_m, grid, self.body, PROPOSAL_ITERATIONS + REFINE_ITERATIONS)
        return True

    def _forget_the_lost(self, seen: bool) -> None:
        """Stops tracking where nobody has been seen for long. A start that was given is not found again."""
        self._empty_frames = 0 if seen else self._empty_frames + 1
        if self._empty_frames >= LOST_FRAMES and self.config.start != "label":
            self.joints_camera_m = None

    def _restarted_if_hopeless(self, joints_m: np.ndarray, depth_m: np.ndarray, grid: DepthGrid) -> np.ndarray:
        """(15, 3) the pose, or that of a new start where the pose has explained the depth badly for long."""
        cost = pose_cost(joints_m, grid, self.body)
        self._hopeless_frames = self._hopeless_frames + 1 if cost > HOPELESS_COST_M2 else 0
        if self._hopeless_frames == 0 or self._hopeless_frames % HOPELESS_FRAMES:
            return joints_m
        found = find_start(depth_m, grid, self.camera, self.config.start, self.config.ridge, self.detector)
        if found is None or pose_cost(found.joints_camera_m, grid, body_from_model(found.model)) > RESTART_RATIO * cost:
            return joints_m
        self.start(found.joints_camera_m, found.model, found.size_deviation)
        self._begin(grid)
        self._visible_points = len(grid.points_m)
        return self.joints_camera_m

    def _begin(self, grid: DepthGrid) -> None:
        """Measures the body in the frame of the start."""
        self._person.begin(self.joints_camera_m, grid, _stride(grid))
        self._adopt_body()
        self._has_begun = True

    def _adopt_body(self) -> None:
        """Goes on with the body estimated so far."""
        if self.body is not self._person.body:
            self.body, self.model = self._person.body, self._person.model
            self.lengths = model_lengths(self.model)

    def _relocated_pose(self, grid: DepthGrid) -> np.ndarray:
        """The last pose, translated with the point cloud if that jumped, as when a person leaves and comes back elsewhere."""
        centroid = grid.points_m.mean(axis=0)
        displacement = np.zeros(3) if self._centroid is None else centroid - self._centroid
        self._centroid = centroid
        return self.joints_camera_m + (displacement if np.linalg.norm(displacement) > RELOCATION_M else 0.0)

    def _algorithm_2(self, depth_m: np.ndarray, grid: DepthGrid) -> tuple[np.ndarray, np.ndarray]:
        """(15, 3) joints of Algorithm 2 and (15,) number of valid candidates of each."""
        ridge = ridge_data(depth_m, self.config.ridge)
        return estimate_pose(ridge, grid, self.joints_camera_m, self.velocity_m, self.body, self.lengths, self.config.hierarchy)

    def _track_body(self, depth_m: np.ndarray, grid: DepthGrid) -> np.ndarray:
        """(15, 3) joints of the fitted body: proposals, detector, perturbations and flip test."""
        previous, body = self.joints_camera_m, self.body
        velocity = np.clip(self.velocity_m, -MAX_STEP_M, MAX_STEP_M)
        expected = previous + VELOCITY_DAMPING * velocity
        stride = _stride(grid)

        def cost(joints: np.ndarray, stride: int) -> float:
            return pose_cost(joints, grid, body, stride) + MOTION_PRIOR_WEIGHT * _motion_prior(joints, expected)

        def best_fitted(starts: list[np.ndarray]) -> tuple[float, np.ndarray]:
            proposals = [fit(start, grid, body, PROPOSAL_ITERATIONS, stride) for start in starts]
            joints = fit(min(proposals, key=lambda joints: cost(joints, stride)), grid, body, REFINE_ITERATIONS, stride)
            joints, _ = refit_limbs(joints, previous, grid, body, stride)
            joints = fit(joints, grid, body, FINAL_ITERATIONS)
            return cost(joints, 1), joints

        extrapolated = extrapolate_rigidly(previous, self.velocity_m)
        starts = [expected, previous, extrapolated, self._algorithm_2(depth_m, grid)[0], *swap_crossed_limbs(previous)]
        best_cost, joints = best_fitted(starts)
        if best_cost < SEARCH_RATIO * self._baseline_cost_m2:
            self._baseline_cost_m2 += BASELINE_RATE * (best_cost - self._baseline_cost_m2)
        if best_cost > DETECTOR_RATIO * self._baseline_cost_m2 and (detected := self._detected(depth_m)) is not None:
            detected = fit(detected, grid, body, FINAL_ITERATIONS, prior_weight=DETECTION_PRIOR_WEIGHT)
            if pose_cost(detected, grid, body) < DETECTOR_REJECT_RATIO * pose_cost(joints, grid, body):
                self._flip_evidence = 0.0
                return detected
        for perturbations, accept_ratio in ((LOCAL_PERTURBATIONS, LOCAL_ACCEPT), (GLOBAL_PERTURBATIONS, GLOBAL_ACCEPT)):
            if self.config.search and best_cost > SEARCH_RATIO * self._baseline_cost_m2:
                alternative_cost, alternative_joints = best_fitted([perturbation(joints) for perturbation in perturbations])
                if alternative_cost < accept_ratio * best_cost:
                    best_cost, joints = alternative_cost, alternative_joints
                    self._flip_evidence = 0.0
        return self._resolve_flip(joints, grid) if self.config.search else joints

    def _resolve_flip(self, joints: np.ndarray, grid: DepthGrid) -> np.ndarray:
        """The pose, or the mirrored one if its cost has been lower for several flip tests.

        A cumulative sum (Page 1954) of the log cost ratio. The evidence belongs to the tracked pose: after a pose from a
        perturbation or a detector is accepted, it restarts at 0.
        """
        self._frames += 1
        if self._frames % FLIP_TEST_INTERVAL or torso_frame(joints)[1, 1] < MIN_UPRIGHT_COSINE:
            return joints
        flipped = fit(joints[MIRROR], grid, self.body, FLIP_TEST_ITERATIONS)
        gain = np.log(pose_cost(joints, grid, self.body) / pose_cost(flipped, grid, self.body))
        self._flip_evidence = max(self._flip_evidence + min(gain, CUSUM_CLIP), 0.0)
        if self._flip_evidence <= CUSUM_THRESHOLD:
            return joints
        self._flip_evidence = 0.0
        return flipped

    def _detected(self, depth_m: np.ndarray) -> np.ndarray | None:
        """The detector's (15, 3) pose; None without a detector or with missing joints."""
        if self.detector is None:
            return None
        joints = self.detector.estimate(depth_m[None], self.camera).joints_camera_m[0].astype(np.float64)
        return joints if np.isfinite(joints).all() else None


def _stride(grid: DepthGrid) -> int:
    """Every how many points about `SUBSAMPLE_POINTS` are."""
    return max(1, len(grid.points_m) // SUBSAMPLE_POINTS)


@njit(cache=True)
def _motion_prior(joints, expected):
    """Mean squared distance of the joints to the expected ones, each distance clipped to `MAX_PRIOR_DISTANCE_M`."""
    total = 0.0
    for j in range(len(joints)):
        squared = 0.0
        for c in range(3):
            squared += (joints[j, c] - expected[j, c]) ** 2
        total += min(squared, MAX_PRIOR_DISTANCE_M**2)
    return total / len(joints)


@njit(cache=True)
def extrapolate_rigidly(joints_m, velocity_m):
    """(15, 3) the pose after repeating the torso's last rigid motion, translation and rotation, with the whole body.

    Args:
        joints_m: (15, 3) the last pose.
        velocity_m: (15, 3) the joints' last step.
    """
    previous_m = joints_m - velocity_m
    frame, previous_frame = torso_frame(joints_m), torso_frame(previous_m)
    centroid, previous_centroid = np.zeros(3), np.zeros(3)
    for joint in TORSO:
        centroid += joints_m[joint] / len(TORSO)
        previous_centroid += previous_m[joint] / len(TORSO)
    extrapolated = np.empty_like(joints_m)
    for j in range(len(joints_m)):
        offset = joints_m[j] - centroid
        rotated = np.zeros(3)
        for axis in range(3):
            rotated += (
                previous_frame[axis, 0] * offset[0] + previous_frame[axis, 1] * offset[1] + previous_frame[axis, 2] * offset[2]
            ) * frame[axis]
        extrapolated[j] = 2 * centroid - previous_centroid + rotated
    return extrapolated
