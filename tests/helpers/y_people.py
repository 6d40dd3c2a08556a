"""People in the Y pose: one of spheres with known joints, and simulated ones from `synth`."""

from collections.abc import Callable, Iterator

import numpy as np
from depth_sensors import measure
from spheres import draw_spheres, row

from kpopnet.camera import Camera
from kpopnet.skeleton import NUM_JOINTS, Joint
from synth.motion import MotionSource
from synth.motion.limbs import uniform
from synth.motion.poses import ProceduralPoses
from synth.samples.placing import StageConfig
from synth.samples.sampler import SampleConfig, Sampler
from synth.scene.props import NO_PROPS
from synth.sensor.model import SENSORS

UPPER_ARM_M, LOWER_ARM_M, UPPER_LEG_M, LOWER_LEG_M = 0.27, 0.26, 0.40, 0.46
TOES_M, CHIN_M = 0.14, 0.05


def y_joints(
    elevation_deg: float = 45.0,
    abduction_deg: float = 12.0,
    elbow_deg: float = 0.0,
    yaw_deg: float = 0.0,
    place_m: tuple[float, float, float] = (0.0, 0.1, 3.0),
) -> np.ndarray:
    """(15, 3) joints in metres of a person 1.7 m tall who faces the camera; `place_m` is the middle of the hips.

    The elbows bend upwards; the heading is positive to the person's left.
    """
    body = np.zeros((NUM_JOINTS, 3))
    body[Joint.HEAD], body[Joint.NECK] = (0, -0.70, 0), (0, -0.54, 0)
    body[Joint.TORSO] = 0, -0.25, 0
    upper, lower = np.radians([elevation_deg - elbow_deg / 2, elevation_deg + elbow_deg / 2])
    abduction = np.radians(abduction_deg)
    for side, sign in (("RIGHT", -1), ("LEFT", 1)):
        at = {name: Joint[f"{side}_{name}"] for name in ("SHOULDER", "ELBOW", "HAND", "HIP", "KNEE", "FOOT")}
        outwards = np.array([sign, 1, 1])
        body[at["SHOULDER"]] = sign * 0.165, -0.50, 0
        body[at["ELBOW"]] = body[at["SHOULDER"]] + UPPER_ARM_M * outwards * (np.cos(upper), -np.sin(upper), 0)
        body[at["HAND"]] = body[at["ELBOW"]] + LOWER_ARM_M * outwards * (np.cos(lower), -np.sin(lower), 0)
        body[at["HIP"]] = sign * 0.105, 0, 0
        leg = outwards * (np.sin(abduction), np.cos(abduction), 0)
        body[at["KNEE"]] = body[at["HIP"]] + UPPER_LEG_M * leg
        body[at["FOOT"]] = body[at["KNEE"]] + LOWER_LEG_M * leg
    yaw = np.radians(yaw_deg)
    # To the person's left: the front, -z, rotates towards larger x.
    return body @ np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]]) + place_m


def draw_y(joints_camera_m: np.ndarray, camera: Camera, back: bool = False) -> np.ndarray:
    """(H, W) float32 metres: spheres along the bones, with chin and toes at the front, or behind if the back is drawn."""
    at = {joint.name: joints_camera_m[joint] for joint in Joint}
    front = np.cross(at["LEFT_HIP"] - at["RIGHT_HIP"], at["NECK"] - at["TORSO"])
    front = front / np.linalg.norm(front) * (-1 if back else 1)
    balls = [*row(at["NECK"], at["HEAD"], 0.055, 0.055, 4), (at["HEAD"], 0.095), (at["HEAD"] + CHIN_M * front, 0.07)]
    hips = (at["RIGHT_HIP"] + at["LEFT_HIP"]) / 2
    for side in ("RIGHT", "LEFT"):
        across = (at[f"{side}_HIP"] - hips) * 0.06 / 0.105
        balls += row(at["NECK"] + 0.15 * (hips - at["NECK"]) + across, hips + across, 0.09, 0.09, 24)
        balls += row(at["NECK"], at[f"{side}_SHOULDER"], 0.06, 0.06, 6)
        balls += row(at[f"{side}_SHOULDER"], at[f"{side}_ELBOW"], 0.055, 0.045, 12)
        fingers = at[f"{side}_HAND"] - at[f"{side}_ELBOW"]
        balls += row(at[f"{side}_ELBOW"], at[f"{side}_HAND"] + 0.06 / LOWER_ARM_M * fingers, 0.045, 0.03, 14)
        balls += row(at[f"{side}_HIP"], at[f"{side}_KNEE"], 0.1, 0.065, 16)
        balls += row(at[f"{side}_KNEE"], at[f"{side}_FOOT"], 0.065, 0.05, 16)
        balls += row(at[f"{side}_FOOT"], at[f"{side}_FOOT"] + TOES_M * front + (0, 0.03, 0), 0.045, 0.035, 8)
    return draw_spheres(balls, camera)


def y_angles(
    generator: np.random.Generator, elevation_deg: tuple[float, float] = (25, 65), elbow_deg: tuple[float, float] = (0, 15)
) -> dict[str, float]:
    """The Y pose with human variation, in the angles of `synth.motion.posture`."""
    abduction, elevation = uniform(generator, 7, 20), uniform(generator, *elevation_deg)
    pose = {"hips_pitch": uniform(generator, -3, 3)}
    for side in ("left", "right"):
        pose |= {
            f"{side}_raise": 90 + np.clip(elevation + uniform(generator, -6, 6), *elevation_deg),
            f"{side}_plane": uniform(generator, -5, 18),
            f"{side}_elbow": uniform(generator, *elbow_deg),
            f"{side}_twist": uniform(generator, -20, 60),
            f"{side}_pronate": uniform(generator, -40, 60),
            f"{side}_flex": uniform(generator, -3, 3),
            f"{side}_abduct": abduction + uniform(generator, -2, 2),
            f"{side}_invert": abduction,
            f"{side}_knee": uniform(generator, 0, 6),
        }
    return pose


def simulated(source: MotionSource, count: int, split: str, seed: int) -> Iterator[tuple[np.ndarray, Camera, np.ndarray]]:
    """Simulated people of a split in a source's poses, approximately facing the camera, as a Kinect v1 measures them.

    Yields (H, W) metres, the camera and the true (15, 3) joints of those who are completely visible in the image.
    """
    stage = StageConfig(distance_m=(2.6, 3.8), off_centre=0.3, cut=0.0, turned=0.0, turn_deg=10.0)
    sampler = Sampler(SampleConfig(renderer="cpu", stage=stage, props=NO_PROPS, samples_per_body=1), seed, split)
    sampler.source = source
    camera = sampler.scene.camera
    for index, rendered in enumerate(sampler.samples(0, count)):
        sample = rendered.sample
        x0, y0, x1, y1 = sample.box
        whole = x0 > 1 and y0 > 1 and x1 < camera.width - 1 and y1 < camera.height - 1
        if whole and sample.visible.all():
            depth_m = sample.depth_mm.astype(np.float32) / 1000
            yield measure(depth_m, SENSORS["kinect_v1"], [seed, index], camera), camera, sample.joints_camera_m


def family(angles: Callable[[np.random.Generator], dict[str, float]]) -> MotionSource:
    """A source of a single family of procedural poses."""
    return ProceduralPoses({angles.__name__: (1.0, angles)})
