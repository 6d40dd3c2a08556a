// A skeleton in 3D that a `View` draws: bones and balls for joints.
import { BONES } from "./learner.js";
import { BufferAttribute, BufferGeometry, Group, Mesh, MeshStandardMaterial, Vector3 } from "./vendor/three.js";

export const JOINTS = 15;
const HEAD = 0, UP = new Vector3(0, 1, 0);

// A solid of rotation about y, from [y, radius] along it.
function turnedSolid(profile, sides = 14) {
  const points = [], faces = [];
  profile.forEach(([y, radius], ring) => {
    for (let side = 0; side < sides; side++) {
      const angle = 2 * Math.PI * side / sides, next = ring * sides + (side + 1) % sides, here = ring * sides + side;
      points.push(radius * Math.cos(angle), y, radius * Math.sin(angle));
      if (ring) faces.push(here, next, here - sides, next, next - sides, here - sides);
    }
  });
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
  geometry.setIndex(faces);
  geometry.computeVertexNormals();
  return geometry;
}
const BONE = turnedSolid([[0, 0.7], [0.15, 1], [0.85, 1], [1, 0.7]]);
const BALL = turnedSolid([...Array(9).keys()].map((k) => [-Math.cos(Math.PI * k / 8), Math.sin(Math.PI * k / 8)]));

export class Figure {
  // colour: of a part of the body.
  constructor(colour) {
    this.group = new Group();
    const solid = (shape, kind, part) => {
      const mesh = new Mesh(shape, new MeshStandardMaterial({ color: colour(part), roughness: 0.8, transparent: true }));
      mesh.userData.solid = kind; // for `FlatRenderer`
      this.group.add(mesh);
      return mesh;
    };
    this.bones = BONES.map(([part]) => solid(BONE, "bone", part));
    this.joints = Array.from({ length: JOINTS }, (_, joint) => solid(BALL, "ball", BONES.find(([, , to]) => to === joint)?.[0] ?? "torso"));
    this.joints.forEach((ball, joint) => ball.scale.setScalar(joint === HEAD ? 0.11 : 0.045));
  }

  // places: [x, y, z] in metres, y up, or null; opacity: of each joint, by default all of it.
  place(places, opacity = null) {
    this.joints.forEach((ball, joint) => {
      ball.visible = places[joint] !== null;
      ball.position.set(...(places[joint] || [0, 0, 0]));
      ball.material.opacity = opacity ? opacity[joint] : 1;
    });
    this.bones.forEach((bone, k) => {
      const [, from, to] = BONES[k], along = this.joints[to].position.clone().sub(this.joints[from].position);
      bone.visible = this.joints[from].visible && this.joints[to].visible;
      bone.material.opacity = opacity ? Math.min(opacity[from], opacity[to]) : 1;
      bone.position.copy(this.joints[from].position);
      bone.scale.set(0.04, Math.max(along.length(), 1e-3), 0.04);
      bone.quaternion.setFromUnitVectors(UP, along.normalize());
    });
  }
}
