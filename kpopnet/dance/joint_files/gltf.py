"""Animated skeletons in glTF 2.0: .gltf and .glb files, and VRM's .vrm and .vrma, which are .glb files that name the bones.

The longest animation that moves the skeleton is sampled at FPS. Joints are the origins of nodes, by forward kinematics of the
node tree with its scales (section 3.5 of Khronos' specification; 3.11 for interpolation). A buffer is in the file, or lies in
the file's folder.
"""

import base64
import struct
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from kpopnet.dance.joint_files.bones import chain, find_joints, skeleton_points, with_torso
from kpopnet.dance.joint_files.points import NamedPoints
from kpopnet.runtime.input_files import check_budget, expect, parse_json, parsing, read_with

FPS = 60.0
_COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


def read_gltf(path: Path) -> NamedPoints:
    """The joints of the skeleton of a glTF file, metres, y up; raises InputError if it is damaged or no person moves in it."""
    with parsing(path, "not a readable glTF 2.0 file"), np.errstate(over="raise", invalid="raise"):
        file = _File(path)
        parents, names = file.tree()
        found = find_joints(names, parents, path)
        bones = {one for joint in found.values() for one in chain(joint, parents)} - {*chain(found["Hips"], parents)[:-1]}
        channels, keys_s = file.longest_animation(bones)
        frames = int((keys_s[-1] - keys_s[0]) * FPS + 1e-3) + 1
        check_budget(path, frames * len(parents) * 128, f"{frames} frames of {len(parents)} nodes")
        times_s = keys_s[0] + np.arange(frames) / FPS
        moved, rest = file.worlds(bones, parents, channels, times_s), file.rest(bones, parents)
        joints, places, carried = with_torso(found, rest[:, :3, 3], parents)
        torso = moved[carried[-1]] @ np.linalg.inv(rest[carried[-1]]) @ [*places[-1], 1]
        ways = [*(moved[node][:, :3, 3] for node in found.values()), torso[:, :3]]
        positions = np.stack([np.broadcast_to(way, (frames, 3)) for way in ways], axis=1)
        return skeleton_points({name: number for number, name in enumerate(joints)}, positions, times_s)


class _File:
    """The content of a glTF file."""

    def __init__(self, path: Path) -> None:
        self.path, self.where = path, str(path)
        data = read_with(Path.read_bytes, path, "cannot be read")
        chunks: dict[bytes, memoryview] = {b"JSON": memoryview(data)}
        if data[:4] == b"glTF":
            version, place, chunks = struct.unpack_from("<I", data, 4)[0], 12, {}
            expect(version == 2, self.where, f"version 2, found {version}")
            while place + 8 <= len(data):
                size, kind = struct.unpack_from("<I4s", data, place)
                expect(place + 8 + size <= len(data), self.where, f"a chunk of {size} bytes; the file is truncated")
                chunks.setdefault(kind, memoryview(data)[place + 8 : place + 8 + size])
                place += 8 + size
        self.content: dict[str, Any] = parse_json(bytes(chunks[b"JSON"]), self.where)
        self._buffers: dict[int, bytes | memoryview] = {} if b"BIN\0" not in chunks else {-1: chunks[b"BIN\0"]}

    def tree(self) -> tuple[list[int], list[str]]:
        """The parent of each node, -1 for none, and its name: that of the humanoid's bone where the file maps them."""
        nodes = self.content["nodes"]
        parents = [-1] * len(nodes)
        for number, node in enumerate(nodes):
            for child in node.get("children", []):
                expect(0 <= child < len(nodes) and parents[child] < 0, f"{self.where}: node {child}", "one parent")
                parents[child] = number
        for node in range(len(nodes)):
            steps = 0
            while node >= 0:
                node, steps = parents[node], steps + 1
                expect(steps <= 1000, self.where, "nodes that are no circle, at most 1000 deep")
        extensions = self.content.get("extensions", {})
        humanoid = next((extensions[one] for one in ("VRMC_vrm_animation", "VRMC_vrm", "VRM") if one in extensions), None)
        if humanoid is None:
            return parents, [str(node.get("name", "")) for node in nodes]
        bones, names = humanoid["humanoid"]["humanBones"], [""] * len(nodes)
        for bone, place in bones.items() if isinstance(bones, dict) else [(one["bone"], one) for one in bones]:
            names[place["node"]] = str(bone)
        return parents, names

    def longest_animation(self, bones: set[int]) -> tuple[dict[int, dict[str, dict]], np.ndarray]:
        """The samplers of each node animated, by what they change, and the (K,) times of all their keys in seconds.

        Of the animations that move one of some nodes: others are of cameras and lights.
        """
        found, keys_s = {}, np.zeros(0)
        for animation in self.content.get("animations", []):
            own: dict[int, dict[str, dict]] = {}
            for channel in animation["channels"]:
                node, sampler = channel["target"].get("node"), animation["samplers"][channel["sampler"]]
                if node is not None and channel["target"]["path"] in _REST:
                    own.setdefault(node, {})[channel["target"]["path"]] = sampler
            if bones.isdisjoint(own):
                continue
            inputs = {sampler["input"] for one in own.values() for sampler in one.values()}
            times_s = np.unique(np.concatenate([np.zeros(0), *(self.numbers(one)[:, 0] for one in inputs)]))
            if len(times_s) and (not len(keys_s) or np.ptp(times_s) > np.ptp(keys_s)):
                found, keys_s = own, times_s
        about = "an animation of a skeleton, found none (a .vrm file is a body; its dance is a .vrma, .bvh or .vmd file)"
        expect(len(keys_s) > 0, self.where, about)
        return found, keys_s

    def worlds(
        self, nodes: Iterable[int], parents: list[int], channels: dict[int, dict[str, dict]], times_s: np.ndarray
    ) -> dict[int, np.ndarray]:
        """(T, 4, 4) transformations of nodes, and of all above them, to the world; (1, 4, 4) where none is animated."""
        found: dict[int, np.ndarray] = {}
        for node in nodes:
            for one in chain(node, parents):
                if one not in found:
                    above = found.get(parents[one], np.eye(4)[None])
                    found[one] = above @ self.local(one, channels.get(one, {}), times_s)
        return found

    def rest(self, nodes: Collection[int], parents: list[int]) -> np.ndarray:
        """(N, 4, 4) transformations of the nodes at rest: to the space of the skin that is bound to all of them, if one is.

        Otherwise to the world, as the file has them without its animation; some programs write them as in its first frame.
        """
        found = np.tile(np.eye(4), (len(parents), 1, 1))
        for node, still in self.worlds(nodes, parents, {}, np.zeros(1)).items():
            found[node] = still[0]
        for skin in self.content.get("skins", []):
            if {*nodes} <= {*skin["joints"]} and "inverseBindMatrices" in skin:
                bound = self.numbers(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
                found[skin["joints"]] = np.linalg.inv(bound)
        return found

    def local(self, node: int, samplers: dict[str, dict], times_s: np.ndarray) -> np.ndarray:
        """(T, 4, 4) transformation to a node's parent; (1, 4, 4) where it is not animated."""
        own = self.content["nodes"][node]
        if "matrix" in own:
            return np.array(own["matrix"], float).reshape(1, 4, 4).swapaxes(1, 2)
        parts = {
            name: self._sampled(samplers[name], times_s, name) if name in samplers else np.array([own.get(name, rest)], float)
            for name, rest in _REST.items()
        }
        matrices = np.zeros((max(map(len, parts.values())), 4, 4))
        matrices[:, :3, :3] = Rotation.from_quat(parts["rotation"]).as_matrix() * parts["scale"][:, None]
        matrices[:, :3, 3], matrices[:, 3, 3] = parts["translation"], 1
        return matrices

    def _sampled(self, sampler: dict, times_s: np.ndarray, name: str) -> np.ndarray:
        """(T, 3 or 4) values of a sampler."""
        keys_s, kind = self.numbers(sampler["input"])[:, 0], sampler.get("interpolation", "LINEAR")
        values = self.numbers(sampler["output"]).reshape(len(keys_s), 3 if kind == "CUBICSPLINE" else 1, len(_REST[name]))
        expect(bool((np.diff(keys_s) > 0).all()), self.where, "times of keys that increase")
        points = values[:, values.shape[1] // 2]
        if len(keys_s) == 1:
            return points
        times_s = np.clip(times_s, keys_s[0], keys_s[-1])
        if kind == "LINEAR" and name == "rotation":
            return Slerp(keys_s, Rotation.from_quat(points))(times_s).as_quat()
        before = np.clip(np.searchsorted(keys_s, times_s, side="right") - 1, 0, len(keys_s) - 2)
        span_s = np.diff(keys_s)[before, None]
        u = (times_s[:, None] - keys_s[before, None]) / span_s
        if kind == "CUBICSPLINE":
            bend = (u**3 - 2 * u**2 + u) * values[before, 2] + (u**3 - u**2) * values[before + 1, 0]
            return (2 * u**3 - 3 * u**2 + 1) * points[before] + (3 * u**2 - 2 * u**3) * points[before + 1] + span_s * bend
        u = np.floor(u + 1e-4) if kind == "STEP" else u  # keys are rounded to 32 bits
        return (1 - u) * points[before] + u * points[before + 1]

    def numbers(self, number: int) -> np.ndarray:
        """(N, width) values of an accessor."""
        accessor = self.content["accessors"][number]
        view = self.content["bufferViews"][accessor["bufferView"]]
        plain = "sparse" not in accessor and "extensions" not in view
        expect(plain, f"{self.where}: accessor {number}", "an animation that is neither sparse nor compressed")
        kind, width = np.dtype(_COMPONENTS[accessor["componentType"]]), _WIDTHS[accessor["type"]]
        step = view.get("byteStride", width * kind.itemsize)
        expect(step >= width * kind.itemsize, f"{self.where}: accessor {number}", "a stride of its values' size or more")
        part = self._buffer(view["buffer"])[view.get("byteOffset", 0) :][: view["byteLength"]]
        place, steps = accessor.get("byteOffset", 0), (step, kind.itemsize)
        values = np.ndarray((accessor["count"], width), kind, part, place, steps).astype(np.float64)
        values = np.maximum(values / np.iinfo(kind).max, -1) if accessor.get("normalized") else values
        expect(bool((np.abs(values) < 1e7).all()), f"{self.where}: accessor {number}", "numbers up to 1e7")
        return values

    def _buffer(self, number: int) -> bytes | memoryview:
        if number not in self._buffers:
            uri = self.content["buffers"][number].get("uri")
            if uri is None:
                self._buffers[number] = self._buffers[-1]
            elif uri.startswith("data:"):
                self._buffers[number] = base64.b64decode(uri.partition(",")[2])
            else:
                folder = self.path.parent.resolve()
                file = (folder / unquote(uri)).resolve()
                expect(file.is_relative_to(folder), self.where, "buffers in the file's own folder")
                self._buffers[number] = read_with(Path.read_bytes, file, "cannot be read")
        return self._buffers[number]
