"""The MuJoCo scene: one person on a tree of ball joints under a skin, a room of boxes, and a camera.

The model is compiled once; other people, poses, rooms and cameras are written into its arrays (a recompile would cost
55 ms, writing a person's arrays a twentieth of one). Both renderers read the same model and data.

World frame: z up, the camera above the origin looking along +y, the floor at z = 0.
"""

from dataclasses import dataclass

import mujoco
import numpy as np

from kpopnet.camera import Camera
from synth.body import BodyAsset, Person, load_body
from synth.capsules import Capsules
from synth.room import MAX_BOXES, Room, View

SKIN_GROUP, ROOM_GROUP, CAPSULE_GROUP = 0, 1, 3  # MuJoCo shows groups 0-2 unless told otherwise
NEAR_M = 0.1
FAR_M = 30.0
UNUSED_BOX_M = -100.0  # boxes that a room does not need wait under the floor


@dataclass(frozen=True)
class Fitted:
    """A person as the model's arrays: B bones, C capsules (see `Scene.fit`)."""

    person: Person
    body_pos: np.ndarray  # (B - 1, 3)
    bind_quat: np.ndarray  # (B, 4)
    capsule_size: np.ndarray  # (C, 2) radius, half length
    capsule_pos: np.ndarray  # (C, 3)
    capsule_quat: np.ndarray  # (C, 4)


class Scene:
    """One compiled model; `dress`, `pose`, `look` and `furnish` change what it shows."""

    def __init__(self, camera: Camera) -> None:
        self.asset = load_body()
        self.camera = camera
        self._capsules = Capsules(self.asset)
        self.model = _compile(self.asset, camera, self._capsules)
        self.data = mujoco.MjData(self.model)
        self.person: Person | None = None
        self.view: View | None = None
        model = self.model
        self._bodies = np.array([model.body(name).id for name in self.asset.bone_names])
        self._quat_address = np.array([model.jnt_qposadr[model.body(name).jntadr[0]] for name in self.asset.bone_names])
        self._quat_address[0] += 3  # the free joint's position comes first
        self._capsule_geoms = np.array([model.geom(f"capsule_{bone}").id for bone in self._capsules.bones])
        self._box_geoms = np.array([model.geom(f"box_{k}").id for k in range(MAX_BOXES)])
        self._may_touch = np.zeros((model.ngeom, model.ngeom), bool)
        self._may_touch[np.ix_(self._capsule_geoms, self._capsule_geoms)] = self._capsules.may_touch(self.asset)

    def fit(self, person: Person) -> "Fitted":
        """What the model's arrays hold when it is this person."""
        parents = self.asset.bone_parents[1:]
        offsets = person.heads_m[1:] - person.heads_m[parents]
        radius, half_length, centre, axis = self._capsules.fit(person)
        return Fitted(
            person=person,
            body_pos=np.einsum("bij,bj->bi", person.t_pose[parents], offsets),
            bind_quat=_quaternions(person.t_pose.transpose(0, 2, 1)),
            capsule_size=np.stack([radius, half_length], axis=1),
            capsule_pos=centre,
            capsule_quat=_quaternions_from_z(axis),
        )

    def dress(self, fitted: "Fitted") -> None:
        """Makes the model this person: bones, skin and capsules."""
        model, capsules = self.model, self._capsule_geoms
        model.body_pos[self._bodies[1:]] = fitted.body_pos
        model.skin_vert[:] = fitted.person.vertices_m
        model.skin_bonebindpos[:] = fitted.person.heads_m
        model.skin_bonebindquat[:] = fitted.bind_quat
        model.geom_size[capsules, :2] = fitted.capsule_size
        model.geom_pos[capsules] = fitted.capsule_pos
        model.geom_quat[capsules] = fitted.capsule_quat
        model.geom_rbound[capsules] = fitted.capsule_size.sum(1)
        self.person = fitted.person

    def pose(self, quats: np.ndarray, root_m: np.ndarray) -> None:
        """Poses the person: (B, 4) local rotations away from the T-pose, (3,) the hips' place; runs the kinematics."""
        self.data.qpos[:3] = root_m
        self.data.qpos[self._quat_address[:, None] + np.arange(4)] = quats
        mujoco.mj_kinematics(self.model, self.data)

    def penetration_m(self) -> float:
        """How deep any two parts of the person that should not touch lie in each other, 0 if none do."""
        mujoco.mj_collision(self.model, self.data)
        contact = self.data.contact
        if not len(contact.dist):
            return 0.0
        ok = self._may_touch[contact.geom1, contact.geom2]
        return float(max(0.0, -contact.dist[~ok].min(initial=0.0)))

    def joints_world_m(self) -> np.ndarray:
        """(15, 3) the person's joints as posed."""
        asset, person = self.asset, self.person
        bones = asset.joint_bones
        rotation = self.data.xmat[self._bodies[bones]].reshape(-1, 3, 3) @ person.t_pose[bones]
        arms = person.joints_m - person.heads_m[bones]
        return self.data.xpos[self._bodies[bones]] + np.einsum("jik,jk->ji", rotation, arms)

    def facing_world(self) -> np.ndarray:
        """(3,) unit vector in which the person's hips face."""
        return -self.data.xmat[self._bodies[0]].reshape(3, 3)[:, 1]

    def look(self, view: View) -> None:
        """Puts the camera where the view says."""
        self.model.cam_pos[0] = view.position_m
        # MuJoCo's cameras look along -z with y up.
        self.model.cam_quat[0] = _quaternions((view.rotation * np.array([1, -1, -1]))[None])[0]
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        self.view = view

    def furnish(self, room: Room) -> None:
        """Makes the room's boxes the model's; runs the kinematics."""
        model = self.model
        model.geom_pos[self._box_geoms] = (0, 0, UNUSED_BOX_M)
        used = self._box_geoms[: len(room.centres_m)]
        model.geom_pos[used] = room.centres_m
        model.geom_size[used] = room.halves_m
        model.geom_quat[used] = np.stack(
            [np.cos(room.yaws_rad / 2), 0 * room.yaws_rad, 0 * room.yaws_rad, np.sin(room.yaws_rad / 2)], axis=1
        )
        model.geom_rbound[used] = np.linalg.norm(room.halves_m, axis=1)
        mujoco.mj_kinematics(model, self.data)


def _compile(asset: BodyAsset, camera: Camera, capsules: Capsules) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE  # its boxes are compiled in, people change
    spec.visual.map.znear, spec.visual.map.zfar = NEAR_M, FAR_M
    spec.stat.extent = 1.0  # znear and zfar are in units of it
    spec.visual.global_.offwidth, spec.visual.global_.offheight = camera.width, camera.height
    spec.visual.quality.offsamples = 0
    bodies = []
    for name, parent in zip(asset.bone_names, asset.bone_parents, strict=True):
        body = (bodies[parent] if parent >= 0 else spec.worldbody).add_body(name=name)
        if parent < 0:
            body.add_freejoint()
        else:
            body.add_joint(type=mujoco.mjtJoint.mjJNT_BALL)
        # A body that moves must have mass; nothing is ever simulated.
        body.mass, body.inertia, body.explicitinertial = 1.0, [1.0, 1.0, 1.0], True
        bodies.append(body)
    for bone in capsules.bones:
        bodies[bone].add_geom(
            name=f"capsule_{bone}", type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[0.1, 0.1, 0], group=CAPSULE_GROUP
        )
    for k in range(MAX_BOXES):
        spec.worldbody.add_geom(
            name=f"box_{k}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[1, 1, 1],
            pos=[0, 0, UNUSED_BOX_M],
            group=ROOM_GROUP,
            contype=0,
            conaffinity=0,
        )
    skin = spec.add_skin(name="skin", group=SKIN_GROUP)
    person_vertices = np.zeros(3 * len(asset.weights), np.float32)
    skin.vert, skin.face = person_vertices, asset.faces.ravel()
    skin.bodyname = list(asset.bone_names)
    skin.bindpos, skin.bindquat = np.zeros(3 * len(bodies)), np.tile([1.0, 0, 0, 0], len(bodies))
    ids, weights = [], []
    for bone in range(len(bodies)):
        share = (asset.weights * (asset.weight_bones == bone)).sum(1)
        ids.append(np.flatnonzero(share > 0).tolist())
        weights.append(share[share > 0].tolist())
    skin.vertid, skin.vertweight = ids, weights
    fovy = np.degrees(2 * np.arctan(camera.height / (2 * camera.fy)))
    spec.worldbody.add_camera(name="camera", fovy=fovy)
    return spec.compile()


def _quaternions(rotations: np.ndarray) -> np.ndarray:
    """(N, 3, 3) rotation matrices to (N, 4) quaternions w, x, y, z."""
    quats = np.empty((len(rotations), 4))
    for quat, rotation in zip(quats, rotations, strict=True):
        mujoco.mju_mat2Quat(quat, np.ascontiguousarray(rotation, np.float64).ravel())
    return quats


def _quaternions_from_z(axes: np.ndarray) -> np.ndarray:
    """(N, 4) rotations that take +z to (N, 3) unit axes: a MuJoCo capsule lies along its own z."""
    quats = np.empty((len(axes), 4))
    for quat, axis in zip(quats, axes, strict=True):
        mujoco.mju_quatZ2Vec(quat, axis)
    return quats
