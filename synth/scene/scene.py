"""The MuJoCo scene: one skinned person on a tree of ball joints, a room of boxes, and a camera.

The model is compiled once. A new person, pose, room or camera pose is written into its arrays: a recompile takes 55 ms,
writing the arrays of a person a twentieth of a millisecond. Both renderers read the same model and data.

World frame: z up, the camera above the origin looking along +y, the floor at z = 0.
"""

from functools import lru_cache

import mujoco
import numpy as np

from kpopnet.camera import Camera
from kpopnet.rotations import about
from synth.body.asset import BodyAsset, load_body
from synth.body.capsules import BONES, fit_capsules, may_touch
from synth.body.outfit import Skin, load_skin
from synth.body.shape import Person
from synth.scene.room import MAX_BOXES, Room, View

SKIN_GROUP, ROOM_GROUP, CAPSULE_GROUP = 0, 1, 3  # MuJoCo renders groups 0-2 by default
NEAR_M = 0.1
FAR_M = 30.0
UNUSED_BOX_Z_M = -100.0  # boxes that a room does not use are placed far below the floor
FITTED_PEOPLE = 64
"""People whose values for the model are kept: to compute them takes longer than to pose and draw the person."""


class Scene:
    """One compiled model. `set_person`, `pose`, `set_view` and `set_room` change its state."""

    def __init__(self, camera: Camera) -> None:
        self.asset = load_body()
        self.skin = load_skin()
        self.camera = camera
        self.model = _compile(self.asset, self.skin, camera)
        self.data = mujoco.MjData(self.model)
        self.person: Person | None = None
        self.view: View | None = None
        self._fit = lru_cache(FITTED_PEOPLE)(self._fitted)
        model = self.model
        self._bodies = np.array([model.body(name).id for name in self.asset.bone_names])
        self._quat_address = np.array([model.jnt_qposadr[model.body(name).jntadr[0]] for name in self.asset.bone_names])
        self._quat_address[0] += 3  # a free joint stores its position first
        self._capsule_geoms = np.array([model.geom(f"capsule_{bone}").id for bone in BONES])
        self._box_geoms = np.array([model.geom(f"box_{k}").id for k in range(MAX_BOXES)])
        self._may_touch = np.zeros((model.ngeom, model.ngeom), bool)
        self._may_touch[np.ix_(self._capsule_geoms, self._capsule_geoms)] = may_touch()

    def _fitted(self, person: Person) -> tuple[np.ndarray, ...]:
        """Of B bones (B - 1, 3) offsets from the parents and (B, 4) bind rotations; of C capsules (C, 2) radius and half
        length, and (C, 3) centre and (C, 4) orientation in the bone's frame; metres.
        """
        parents = self.asset.bone_parents[1:]
        offsets = np.einsum("bij,bj->bi", person.t_pose[parents], person.heads_m[1:] - person.heads_m[parents])
        radius, half_length, centre, axis = fit_capsules(person)
        # A MuJoCo capsule lies along its own z axis.
        capsules = np.stack([radius, half_length], axis=1), centre, _quaternions(axis)
        return offsets, _quaternions(person.t_pose.transpose(0, 2, 1)), *capsules

    def set_person(self, person: Person) -> None:
        """Writes the bones, skin and capsules of a person into the model, unless they are there already."""
        if person is self.person:
            return
        model, capsules = self.model, self._capsule_geoms
        offsets, bind_quats, sizes, centres, quats = self._fit(person)
        model.body_pos[self._bodies[1:]] = offsets
        model.skin_vert[:] = person.vertices_m
        model.skin_bonebindpos[:] = person.heads_m
        model.skin_bonebindquat[:] = bind_quats
        model.geom_size[capsules, :2], model.geom_rbound[capsules] = sizes, sizes.sum(1)
        model.geom_pos[capsules], model.geom_quat[capsules] = centres, quats
        self.person = person

    def pose(self, quats: np.ndarray, root_m: np.ndarray) -> None:
        """Poses the person: (B, 4) local rotations relative to the T-pose, hips at (3,) metres in the world."""
        self.data.qpos[:3] = root_m
        self.data.qpos[self._quat_address[:, None] + np.arange(4)] = quats
        mujoco.mj_kinematics(self.model, self.data)

    def penetration_m(self) -> float:
        """Largest penetration depth, metres, over the pairs of capsules that must not touch; 0 without a contact."""
        mujoco.mj_collision(self.model, self.data)
        contact = self.data.contact
        if not len(contact.dist):
            return 0.0
        ok = self._may_touch[contact.geom1, contact.geom2]
        return float(max(0.0, -contact.dist[~ok].min(initial=0.0)))

    def joints_world_m(self) -> np.ndarray:
        """(15, 3) joints of the posed person in the world, metres."""
        asset, person = self.asset, self.person
        bones = asset.joint_bones
        rotation = self.data.xmat[self._bodies[bones]].reshape(-1, 3, 3) @ person.t_pose[bones]
        arms = person.joints_m - person.heads_m[bones]
        return self.data.xpos[self._bodies[bones]] + np.einsum("jik,jk->ji", rotation, arms)

    def facing_world(self) -> np.ndarray:
        """(3,) unit vector in which the person's hips face, world frame."""
        return -self.data.xmat[self._bodies[0]].reshape(3, 3)[:, 1]

    def bone_rotation(self, name: str) -> np.ndarray:
        """(3, 3) rotation of a bone in the world from the T-pose."""
        return self.data.xmat[self._bodies[self.asset.bone(name)]].reshape(3, 3)

    def set_view(self, view: View) -> None:
        self.model.cam_pos[0] = view.position_m
        # MuJoCo's cameras look along -z with y up.
        self.model.cam_quat[0] = _quaternions((view.rotation * np.array([1, -1, -1]))[None])[0]
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        self.view = view

    def set_room(self, room: Room) -> None:
        model = self.model
        model.geom_pos[self._box_geoms] = (0, 0, UNUSED_BOX_Z_M)
        used = self._box_geoms[: len(room.centres_m)]
        model.geom_pos[used] = room.centres_m
        model.geom_size[used] = room.halves_m
        model.geom_quat[used] = about(2, room.yaws_rad)
        model.geom_rbound[used] = np.linalg.norm(room.halves_m, axis=1)
        mujoco.mj_kinematics(model, self.data)


def _compile(asset: BodyAsset, worn: Skin, camera: Camera) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    # The bounding volumes of the mid-phase collision test are compiled in and would be wrong for another person.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE
    spec.visual.map.znear, spec.visual.map.zfar = NEAR_M, FAR_M
    spec.stat.extent = 1.0  # the unit of znear and zfar
    spec.visual.global_.offwidth, spec.visual.global_.offheight = camera.width, camera.height
    spec.visual.quality.offsamples = 0
    bodies = []
    for name, parent in zip(asset.bone_names, asset.bone_parents, strict=True):
        body = (bodies[parent] if parent >= 0 else spec.worldbody).add_body(name=name)
        if parent < 0:
            body.add_freejoint()
        else:
            body.add_joint(type=mujoco.mjtJoint.mjJNT_BALL)
        # MuJoCo requires a mass of a moving body. The dynamics are never simulated.
        body.mass, body.inertia, body.explicitinertial = 1.0, [1.0, 1.0, 1.0], True
        bodies.append(body)
    for bone in BONES:
        bodies[bone].add_geom(
            name=f"capsule_{bone}", type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[0.1, 0.1, 0], group=CAPSULE_GROUP
        )
    for k in range(MAX_BOXES):
        box = spec.worldbody.add_geom(name=f"box_{k}", type=mujoco.mjtGeom.mjGEOM_BOX, group=ROOM_GROUP)
        box.size, box.pos, box.contype, box.conaffinity = [1, 1, 1], [0, 0, UNUSED_BOX_Z_M], 0, 0
    skin = spec.add_skin(name="skin", group=SKIN_GROUP)
    skin.vert, skin.face = np.zeros(3 * len(worn.weights), np.float32), worn.faces.ravel()
    skin.bodyname = list(asset.bone_names)
    skin.bindpos, skin.bindquat = np.zeros(3 * len(bodies)), np.tile([1.0, 0, 0, 0], len(bodies))
    ids, weights = [], []
    for bone in range(len(bodies)):
        weight = (worn.weights * (worn.weight_bones == bone)).sum(1)
        ids.append(np.flatnonzero(weight > 0).tolist())
        weights.append(weight[weight > 0].tolist())
    skin.vertid, skin.vertweight = ids, weights
    fovy = np.degrees(2 * np.arctan(camera.height / (2 * camera.fy)))
    spec.worldbody.add_camera(name="camera", fovy=fovy)
    return spec.compile()


def _quaternions(given: np.ndarray) -> np.ndarray:
    """(N, 4) quaternions w, x, y, z of rotation matrices (N, 3, 3), or of the rotations that map +z to unit axes (N, 3)."""
    quats = np.empty((len(given), 4))
    for quat, one in zip(quats, np.ascontiguousarray(given, np.float64), strict=True):
        (mujoco.mju_quatZ2Vec if one.ndim == 1 else mujoco.mju_mat2Quat)(quat, one.ravel())
    return quats
