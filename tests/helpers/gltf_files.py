"""Motions as glTF 2.0 files, written from the specification."""

import base64
import json
import struct

import numpy as np

from synth.motion.skeleton import JOINT_NAMES, PARENTS, REST_OFFSETS_M

HUMANOID = {"Hips": "hips", "LowerBack": "spine", "Spine": "chest", "Spine1": "upperChest", "Neck": "neck", "Head": "head"} | {
    side + ours: side.lower() + theirs
    for side in ("Left", "Right")
    for ours, theirs in (
        ("Shoulder", "Shoulder"), ("Arm", "UpperArm"), ("ForeArm", "LowerArm"), ("Hand", "Hand"), ("UpLeg", "UpperLeg"),
        ("Leg", "LowerLeg"), ("Foot", "Foot"), ("ToeBase", "Toes"),
    )
}  # fmt: skip
"""VRM's names of the bones."""


def write_gltf(path, motion, *, interpolation="LINEAR", humanoid=None, uri=None, integers=False, resting=None, change=None):
    """Writes a motion: centimetres below an armature of scale 0.01 with z up, a node for each joint.

    `humanoid` names an extension of VRM's, `uri` puts the binary part there ("data:" into the JSON) instead of a chunk,
    `integers` stores rotations as normalised 16-bit integers, `resting` (J, 4) are the nodes' own rotations instead of the
    T-pose, in which a skin is bound then, in metres, and `change` changes the JSON before it is written.
    """
    times = np.arange(len(motion)) / motion.fps
    chunk, views, accessors = b"", [], []

    def add(values):
        nonlocal chunk
        values = np.asarray(values, "<i2" if integers and values.shape[-1] == 4 else "<f4")
        views.append({"buffer": 0, "byteOffset": len(chunk), "byteLength": values.nbytes})
        kind = {"i": 5122, "f": 5126}[values.dtype.kind]
        shape = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[values.shape[-1]]
        extra = {"normalized": True} if kind == 5122 else {}
        accessors.append(
            {"bufferView": len(views) - 1, "componentType": kind, "count": values.size // values.shape[-1], "type": shape}
            | extra
        )
        chunk += values.tobytes() + b"\0" * (-values.nbytes % 4)
        return len(accessors) - 1

    def keyed(values):
        if interpolation != "CUBICSPLINE":
            return values
        slopes = np.gradient(values, 1 / motion.fps, axis=0)
        return np.stack([slopes, values, slopes], axis=1)

    start = add(times[:, None])
    nodes = [{"name": "Armature", "rotation": [2**-0.5, 0, 0, 2**-0.5], "scale": [0.01] * 3, "children": [1]}]
    samplers, channels = [], []
    for joint, name in enumerate(JOINT_NAMES):
        children = [1 + child for child, parent in enumerate(PARENTS[: len(JOINT_NAMES)]) if parent == joint]
        named = {} if humanoid else {"name": f"mixamorig:{name}"}
        named |= {} if resting is None else {"rotation": np.roll(resting[joint], -1).tolist()}
        nodes.append(
            named | {"translation": (100 * REST_OFFSETS_M[joint]).tolist()} | ({"children": children} if children else {})
        )
        tracks = {"rotation": np.roll(motion.quats[:, joint], -1, axis=-1)}
        if joint == 0:
            tracks["translation"] = 100 * motion.root_m
        for kind, values in tracks.items():
            samplers.append(
                {
                    "input": start,
                    "interpolation": interpolation,
                    "output": add(keyed(values * (32767 if integers and kind == "rotation" else 1))),
                }
            )
            channels.append({"sampler": len(samplers) - 1, "target": {"node": 1 + joint, "path": kind}})
    bones = {HUMANOID[name]: {"node": 1 + joint} for joint, name in enumerate(JOINT_NAMES) if name in HUMANOID}
    if humanoid == "VRM":
        bones = [{"bone": bone} | place for bone, place in bones.items()]
    skin = {}
    if resting is not None:
        bound = np.tile(np.eye(4), (len(JOINT_NAMES), 1, 1))
        for joint, parent in enumerate(PARENTS[: len(JOINT_NAMES)]):
            bound[joint, :3, 3] = REST_OFFSETS_M[joint] + (bound[parent, :3, 3] if parent >= 0 else 0)
        to_bone = np.diag([100, 100, 100, 1]) @ np.linalg.inv(bound)
        matrices = add(to_bone.swapaxes(1, 2).reshape(-1, 16))
        skin = {"skins": [{"joints": [1 + joint for joint in range(len(JOINT_NAMES))], "inverseBindMatrices": matrices}]}
    content = {
        "asset": {"version": "2.0"}, "nodes": nodes, "accessors": accessors, "bufferViews": views,
        "animations": [{"samplers": samplers, "channels": channels}],
        "buffers": [{"byteLength": len(chunk)} | ({"uri": uri} if uri else {})],
    } | skin | ({"extensions": {humanoid: {"humanoid": {"humanBones": bones}}}} if humanoid else {})  # fmt: skip
    if uri == "data:":
        content["buffers"][0]["uri"] = f"data:application/octet-stream;base64,{base64.b64encode(chunk).decode()}"
    elif uri and change is None:
        (path.parent / uri).write_bytes(chunk)
    if change:
        change(content)
    text = json.dumps(content).encode()
    if uri:
        path.write_bytes(text)
        return path
    text += b" " * (-len(text) % 4)
    parts = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(chunk), b"BIN\0") + chunk
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts)
    return path
