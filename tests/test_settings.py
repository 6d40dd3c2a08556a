"""Settings that cannot be: each is refused by the name that a user types, with what was expected."""

import math
from functools import partial

import pytest

from kpopnet.dance.paper import PaperScorer
from kpopnet.dance.parts import PartScorer
from kpopnet.data.batches import AugmentConfig
from kpopnet.errors import InputError
from kpopnet.evaluation.config import EvaluateConfig
from kpopnet.networks import ModelConfig
from kpopnet.paper_extraction import PaperExtractionConfig
from kpopnet.paper_tracker.tracker import PaperTrackerConfig
from kpopnet.ridge import RidgeConfig
from kpopnet.tracker.estimator import TrackerEstimatorConfig
from kpopnet.training.distributed import set_up_torch
from kpopnet.training.finder import FinderTraining
from kpopnet.training.loop import TrainingConfig
from synth.__main__ import GenerateConfig, parse_range
from synth.body.shape import BodyConfig
from synth.dances.simulate import KpopSimConfig
from synth.motion import MotionConfig
from synth.rooms.images import RoomImagesConfig
from synth.samples.observe import Observer
from synth.samples.placing import StageConfig
from synth.samples.sampler import CameraConfig
from synth.sensor.model import SensorConfig
from synth.simulated.check_sim import CheckSimConfig
from synth.simulated.rooms import RoomsConfig
from synth.simulated.stand_ins import EvalSimConfig

TOLD = {
    r"ridge\.epsilon_r": partial(RidgeConfig, epsilon_r=-0.1),
    r"extraction\.delta_f_m": partial(PaperExtractionConfig, delta_f_m=math.nan),
    r"start=sitting: expected one of auto, y_pose, standing, label": partial(TrackerEstimatorConfig, start="sitting"),
    r"^estimator\.paper_tracker: expected r_m in 0\.\.2 m": partial(PaperTrackerConfig, r_m=110),
    r"^estimator\.paper_tracker: .*epsilon_r in 0\.\.1.* 1\.5 and": partial(PaperTrackerConfig, epsilon_r=1.5),
    r"^estimator\.paper_tracker\.lost=found: expected one of predicted,": partial(PaperTrackerConfig, lost="found"),
    r"^estimator\.paper_tracker\.start=standing: expected one of y_pose": partial(PaperTrackerConfig, start="standing"),
    r"model\.kind=denser: expected one of holistic, dense": partial(ModelConfig, kind="denser"),
    r"model\.crop_px=100: expected a multiple of 16": partial(ModelConfig, crop_px=100),
    r"model\.half_size_m=115\.0: expected metres": partial(ModelConfig, half_size_m=115.0),
    r"four multiples of 8": partial(ModelConfig, widths=[4, 8, 8, 16]),
    r"training\.lr": partial(TrainingConfig, lr=-1.0),
    r"training\.part=outlines: expected one of finder, masks": partial(FinderTraining, part="outlines"),
    r"^training\.augment\.rotation_deg=-3": partial(AugmentConfig, rotation_deg=-3.0),
    r"^threads=-1: expected a number in 0\.\.1024": partial(set_up_torch, -1),
    r"^threads=100000": partial(set_up_torch, 100_000),
    r"processes=-1": partial(EvaluateConfig, None, {}, processes=-1),
    r"seed=-1": partial(EvaluateConfig, None, {}, seed=-1),
    r"^noise=odd: expected one of auto, none, .*tracker": partial(PartScorer, noise="odd"),
    r"^feature=odd: .*dance22, dance22_turn, raptis": partial(PaperScorer, feature="odd"),
    r"motion\.fps=nan": partial(MotionConfig, fps=math.nan),
    r"motion\.fps=60\.0: the rate of BVH files": partial(MotionConfig, source="choreography", fps=60.0),
    r"set motion\.path": partial(MotionConfig, weights={"clips": 0.5, "poses": 0.5}),
    r"sensor\.name=kinect: expected one of ideal, kinect_v1": partial(SensorConfig, "kinect"),
    r"sensor\.lateral_px needs a sensor\.native_focal_px": partial(SensorConfig, "ideal", lateral_px=1.0),
    r"sensor\.lateral_grazing_px needs a sensor\.native": partial(SensorConfig, "ideal", lateral_grazing_px=1.0),
    r"camera\.name=gopro": CameraConfig("gopro").build,
    r"^other_sensors=.*expected probabilities of ideal, ": partial(Observer, *[None] * 4, {"kinect_v1": 0.6, "kinect_2": 0.6}),
    r"^other_sensors=.*gopro": partial(Observer, *[None] * 4, {"gopro": 0.1}),
    r"^frozen and splits: \['exam'\] are no splits; choose from train": partial(GenerateConfig, splits={"exam": 3}),
    r"^every split has size 0": GenerateConfig,
    r"shards=five: give .*0:100": partial(parse_range, "five", 9),
    r"shards=5:5: the first number": partial(parse_range, "5:5", 9),
    r"stage\.distance_m": partial(StageConfig, distance_m=(3, 2)),
    r"benchmark\.dances=": partial(KpopSimConfig, dances=101),
    r"benchmark\.split=": partial(KpopSimConfig, split="exam"),
    r"benchmark\.sequences=": partial(EvalSimConfig, sequences=25),
    r"benchmark\.seed=": partial(EvalSimConfig, seed=-1),
    r"benchmark\.children=": partial(EvalSimConfig, children=1.5),
    r"benchmark\.children=-0.1": partial(RoomImagesConfig, children=-0.1),
    r"body\.children=": partial(BodyConfig, children=2),
    r"benchmark\.cameras.*kinect_v1": partial(CheckSimConfig, cameras=["phone"]),
    r"benchmark\.kinds=.*expected some of alone_still": partial(RoomsConfig, kinds=["alone_still", "asleep"]),
}
"""What is told, to settings."""


@pytest.mark.parametrize("told", TOLD)
def test_a_setting_that_cannot_be_is_refused_by_name(told: str) -> None:
    with pytest.raises(InputError, match=told):
        TOLD[told]()
