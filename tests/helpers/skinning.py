"""Linear blend skinning in numpy: the slow twin of MuJoCo's."""

import numpy as np

from synth.body.asset import load_body
from synth.body.outfit import load_skin
from synth.body.shape import Person


def skinned(person: Person, rotations: np.ndarray, root_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) vertices and (15, 3) joints in the world, metres, of (B, 3, 3) local rotations relative to the T-pose and the head
    of the hips bone in the world.
    """
    asset, skin = load_body(), load_skin()
    world_rotation, world_m = np.empty((len(rotations), 3, 3)), np.empty((len(rotations), 3))
    for bone, parent in enumerate(asset.bone_parents):
        if parent < 0:
            world_rotation[bone], world_m[bone] = rotations[bone], root_m
        else:
            world_rotation[bone] = world_rotation[parent] @ rotations[bone]
            offset = person.t_pose[parent] @ (person.heads_m[bone] - person.heads_m[parent])
            world_m[bone] = world_m[parent] + world_rotation[parent] @ offset
    skinning = world_rotation @ person.t_pose  # from the rest pose to the world
    moved = np.einsum(
        "vkij,vkj->vki", skinning[skin.weight_bones], person.vertices_m[:, None] - person.heads_m[skin.weight_bones]
    )
    vertices = np.einsum("vk,vki->vi", skin.weights, moved + world_m[skin.weight_bones])
    offsets = person.joints_m - person.heads_m[asset.joint_bones]
    joints = np.einsum("jik,jk->ji", skinning[asset.joint_bones], offsets) + world_m[asset.joint_bones]
    return vertices, joints
