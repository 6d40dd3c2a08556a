"""The body tracker: estimates one person's joints frame by frame from depth, by a body fitted to it.

A frame passes five stages, each in a file with its own settings:

1. predict (`prediction.py`): the pose expected from the last ones.
2. propose: the expected and the last pose, and where limbs cross, the last pose with the limbs exchanged.
3. fit (`fitting.py`): a body is fitted to the measured points from each proposal; the best is kept, and its limbs are laid anew
   where that lowers the cost.
4. detect (`search.py`): if the pose costs more than this person's poses usually do, a detector is queried, where there is one.
5. search (`search.py`): if it costs much more, the pose is tried rotated, bent and mirrored, now and then; and at regular
   intervals the mirrored body is compared with it, to detect a flip of front and back.

Nothing depends on wall-clock time: equal input gives equal output.
"""

from dataclasses import dataclass, field

import numpy as np

from kpopnet.camera import Camera
from kpopnet.errors import check_between
from kpopnet.estimator import Estimator, start_pose
from kpopnet.geometry.body import Body, body_from_model
from kpopnet.geometry.depth_grid import MIN_POINTS, DepthGrid, build_depth_grid
from kpopnet.geometry.human_model import HumanModel
from kpopnet.ridge import RidgeConfig
from kpopnet.skeleton import NUM_JOINTS
from kpopnet.tracker.fit.confidence import TRACKED_WEIGHTS, fit_score, probability, tracked_evidence
from kpopnet.tracker.fit.limbs import swap_crossed_limbs
from kpopnet.tracker.fit.objective import pose_cost
from kpopnet.tracker.fit.solver import fit
from kpopnet.tracker.fitting import Fitted, Fitting, FittingConfig, stride_of
from kpopnet.tracker.lengths import RunningLengths
from kpopnet.tracker.prediction import PredictionConfig, State, dropped_out, predict
from kpopnet.tracker.search import DoubtConfig, SearchConfig, flipped, search, take_detected
from kpopnet.tracker.start.finding import find_start

START_ITERATIONS = 5
"""Gauss-Newton iterations from a start pose that the tracker found."""


@dataclass(frozen=True)
class RestartConfig:
    """Settings of when the tracker starts anew.

    Attributes:
        lost_frames: after so many frames without the person, the tracker starts with whoever comes.
        hopeless_cost_m2: a pose that costs more than this many square metres explains the depth badly.
        hopeless_frames: after so many such frames in a row a start is looked for, and every as many frames.
        accept: the new start is taken below this fraction of the cost.
    """

    lost_frames: int = 30
    hopeless_cost_m2: float = 2e-3
    hopeless_frames: int = 30
    accept: float = 0.6

    def __post_init__(self) -> None:
        check_between("restart.lost_frames", self.lost_frames, 1, 1_000_000)
        check_between("restart.hopeless_frames", self.hopeless_frames, 1, 1_000_000)


@dataclass(frozen=True)
class TrackerConfig:
    """Settings of the tracker.

    Attributes:
        ridge: parameters of the ridge data, for the Y pose.
        start: auto (the Y pose, else a network's joints where `network` names one, else anybody who stands or sits upright),
            y_pose (waits for the paper's start pose), standing (whoever stands upright), or label (the benchmark's true joints
            in the first frame that has all of them).
        lengths: estimate the person's lengths and thickness over the frames, instead of keeping those of the start.
        prediction: what is expected of the next frame.
        fitting: the fit to each frame.
        doubt: when a pose is doubted.
        search: what is tried then.
        restart: when the tracker starts anew.
    """

    ridge: RidgeConfig = field(default_factory=RidgeConfig)
    start: str = "auto"
    lengths: bool = False
    prediction: PredictionConfig = field(default_factory=PredictionConfig)
    fitting: FittingConfig = field(default_factory=FittingConfig)
    doubt: DoubtConfig = field(default_factory=DoubtConfig)
    search: SearchConfig = field(default_factory=SearchConfig)
    restart: RestartConfig = field(default_factory=RestartConfig)


class Tracker:
    """Tracks one person through consecutive frames. Without a given start pose it finds one (`TrackerConfig.start`).

    Attributes:
        model: the person's lengths, None before the start unless given; `HumanModel.save` stores it for later recordings.
        body: the model as round cones, for the kernels of the fit; None before the start.
        state: what is carried from frame to frame, None before the start.
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
            detector: an estimator that is queried for the pose of a single frame at the start (`start=auto`) and when the cost
                is high, for instance a network.
        """
        self.camera = camera
        self.config = config
        self.model = model
        self.detector = detector
        self._known_model = model
        self._person: RunningLengths | None = None
        self._has_begun, self._empty_frames = False, 0
        self.body: Body | None = None
        self.state: State | None = None
        self.evidence: np.ndarray | None = None

    @property
    def started(self) -> bool:
        """Whether there is a pose to track from."""
        return self.state is not None

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
        joints = start_pose(joints_camera_m, "tracker")
        learned = self.config.lengths and self._known_model is None
        self.model = self._known_model or model or HumanModel.from_joints(joints)
        self._person = RunningLengths(self.model, size_deviation if learned else None)
        self._has_begun = False
        self.body = self._person.body
        self.state = State(joints, self.config.doubt.baseline_m2)

    def track(self, depth_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tracks the person in the next frame.

        Args:
            depth_m: (H, W) float32 metres of the person, 0 elsewhere.

        Returns:
            (15, 3) float64 joints in the camera frame in metres and (15,) confidence, the estimated probability of an error
            below 10 cm; NaN and 0 before the start and in frames without a visible person.
        """
        grid = build_depth_grid(depth_m, self.camera)
        self._forget_the_lost(len(grid.points_m) >= MIN_POINTS)
        if len(grid.points_m) < MIN_POINTS or not (self.started or self._find_start(depth_m, grid)):
            return np.full((NUM_JOINTS, 3), np.nan), np.zeros(NUM_JOINTS)
        state = self.state
        if not self._has_begun:
            self._begin(grid)
        if dropped_out(state, grid, self.config.prediction):
            return state.joints_m.copy(), self._confidence(grid)
        expected_m = predict(state, grid, self.config.prediction)
        joints_m = self._fitted(expected_m, depth_m, grid)
        state.joints_m, state.velocity_m = joints_m, joints_m - state.joints_m
        self._person.update(joints_m, grid, stride_of(grid, self.config.fitting))
        self._adopt_body()
        self._restart_if_hopeless(depth_m, grid)
        return self.state.joints_m.copy(), self._confidence(grid)

    def miss(self) -> None:
        """Goes on to the next frame, which does not show the person: as `track` with an empty image."""
        self._forget_the_lost(False)

    def _fitted(self, expected_m: np.ndarray, depth_m: np.ndarray, grid: DepthGrid) -> np.ndarray:
        """(15, 3) joints of the body fitted to the frame: propose, fit, detect, search."""
        last_m = self.state.joints_m
        fitting = Fitting(grid, self.body, last_m, expected_m, self.config.fitting)
        fitted = fitting.best([expected_m, last_m, *swap_crossed_limbs(last_m)])
        return self._detect_or_search(fitted, depth_m, fitting).joints_m

    def _detect_or_search(self, fitted: Fitted, depth_m: np.ndarray, fitting: Fitting) -> Fitted:
        """The fitted pose, or a better one that a detector or the search finds if it costs too much."""
        state, doubt, config = self.state, self.config.doubt, self.config.search
        if fitted.cost_m2 < doubt.search_ratio * state.baseline_cost_m2:
            state.baseline_cost_m2 += doubt.baseline_rate * (fitted.cost_m2 - state.baseline_cost_m2)
        found = None
        if fitted.cost_m2 > doubt.detector_ratio * state.baseline_cost_m2 and (detected := self._detected(depth_m)) is not None:
            found = take_detected(detected, fitted, fitting, config)
        limit_m2, state.searched = doubt.search_ratio * state.baseline_cost_m2, state.searched + 1
        if found is None and fitted.cost_m2 > limit_m2 and 0 < config.every <= state.searched:
            found, state.searched = search(fitted, limit_m2, fitting, config), 0
        if found is not None and found is not fitted:
            state.flip_evidence = 0.0
            return found
        return flipped(fitted, state, fitting, config) or fitted

    def _confidence(self, grid: DepthGrid) -> np.ndarray:
        """(15,) confidence of the last pose."""
        self.evidence = tracked_evidence(fit_score(self.state.joints_m, grid, self.body))
        return probability(self.evidence, TRACKED_WEIGHTS)

    def _find_start(self, depth_m: np.ndarray, grid: DepthGrid) -> bool:
        """Starts if the frame shows a pose to start from; returns whether the tracker has started."""
        found = find_start(depth_m, grid, self.camera, self.config.start, self.config.ridge, self.detector)
        if found is None:
            return False
        self.start(found.joints_camera_m, found.model, found.size_deviation)
        # Fit before measuring the thickness: a displaced pose would give too thick or too thin parts.
        self.state.joints_m = fit(self.state.joints_m, grid, self.body, START_ITERATIONS)
        return True

    def _begin(self, grid: DepthGrid) -> None:
        """Measures the body in the frame of the start."""
        self._person.begin(self.state.joints_m, grid, stride_of(grid, self.config.fitting))
        self._adopt_body()
        self._has_begun = True

    def _adopt_body(self) -> None:
        """Goes on with the body estimated so far."""
        if self.body is not self._person.body:
            self.body, self.model = self._person.body, self._person.model

    def _forget_the_lost(self, seen: bool) -> None:
        """Stops tracking where nobody has been seen for long. A start that was given is not found again."""
        self._empty_frames = 0 if seen else self._empty_frames + 1
        if self._empty_frames >= self.config.restart.lost_frames and self.config.start != "label":
            self.state = None

    def _restart_if_hopeless(self, depth_m: np.ndarray, grid: DepthGrid) -> None:
        """Starts anew where the pose has explained the depth badly for long, and a start does better."""
        state, config = self.state, self.config.restart
        cost_m2 = pose_cost(state.joints_m, grid, self.body)
        state.hopeless = state.hopeless + 1 if cost_m2 > config.hopeless_cost_m2 else 0
        if state.hopeless == 0 or state.hopeless % config.hopeless_frames:
            return
        found = find_start(depth_m, grid, self.camera, self.config.start, self.config.ridge, self.detector)
        if found is None or pose_cost(found.joints_camera_m, grid, body_from_model(found.model)) > config.accept * cost_m2:
            return
        self.start(found.joints_camera_m, found.model, found.size_deviation)
        self._begin(grid)
        dropped_out(self.state, grid, self.config.prediction)

    def _detected(self, depth_m: np.ndarray) -> np.ndarray | None:
        """The detector's (15, 3) pose; None without a detector or with missing joints."""
        if self.detector is None:
            return None
        joints = self.detector.estimate(depth_m[None], self.camera).joints_camera_m[0].astype(np.float64)
        return joints if np.isfinite(joints).all() else None
