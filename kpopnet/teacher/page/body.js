// Bodies in 3D: a skin on bones that plays the movements of the library.
import {
  BufferAttribute, BufferGeometry, Bone, CircleGeometry, Color, DirectionalLight, GridHelper, Group, HemisphereLight, Matrix4, Mesh,
  MeshStandardMaterial, OrbitControls, PerspectiveCamera, Quaternion, Scene, Skeleton, SkinnedMesh, WebGLRenderer,
} from "./vendor/three.js";
import { FlatLoad, FlatRenderer } from "./flat.js";
import { ask, clamp, unpacked } from "./tools.js";

let body = null;

export async function loadBody() {
  body ??= bodyOf(await ask("/api/body"));
  return body;
}

export function bodyOf(found) {
  return {
    ...found,
    vertices: unpacked(found.vertices_m, Float32Array),
    faces: unpacked(found.faces, Uint16Array),
    bones: Uint16Array.from(unpacked(found.weight_bones, Uint8Array)),
    weights: unpacked(found.weights, Float32Array),
  };
}

// A movement of the server: rotations of the bones and positions of the hips.
export function movementOf(packed) {
  const hips = unpacked(packed.hips_m, Float32Array);
  return { fps: packed.fps, frames: hips.length / 3, hips, quats: unpacked(packed.quats, Int16Array), begin_s: packed.begin_s || 0 };
}

const CLOTHES = [
  [/Head|Neck|Hand|Thumb|Finger/, "skin"], [/Foot|Toe/, "shoes"], [/Hips|Leg|LowerBack/, "waist"], [/./, "shirt"],
];
const WAIST_M = 0.05; // above the hips' bone: where trousers end
const BROW_M = 0.09; // above the head's bone: where hair begins in front of it, behind it at its height
const COLOURS = {
  teacher: { skin: "#d9a57e", hair: "#3a2a22", shoes: "#2b2b33", trousers: "#3d4b78", shirt: "#b05bc4" },
  learner: { skin: "#b98a68", hair: "#1f1b1a", shoes: "#2b2b33", trousers: "#56606b", shirt: "#e0a43a" },
};

function geometryOf(found, colours) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(found.vertices, 3));
  geometry.setIndex(new BufferAttribute(found.faces, 1));
  geometry.setAttribute("skinIndex", new BufferAttribute(found.bones, 4));
  geometry.setAttribute("skinWeight", new BufferAttribute(found.weights, 4));
  const paint = Object.fromEntries(Object.entries(colours).map(([piece, colour]) => [piece, new Color(colour)]));
  const pieces = found.names.map((name) => CLOTHES.find(([pattern]) => pattern.test(name))[1]);
  const waist_m = found.heads_m[found.names.indexOf("Hips")][2] + WAIST_M;
  const shown = new Float32Array(found.vertices.length);
  for (let vertex = 0; vertex < shown.length / 3; vertex++) {
    let heaviest = 0;
    for (let k = 1; k < 4; k++) if (found.weights[4 * vertex + k] > found.weights[4 * vertex + heaviest]) heaviest = k;
    const bone = found.bones[4 * vertex + heaviest], [, head_y, head_z] = found.heads_m[bone];
    const [, y, z] = found.vertices.subarray(3 * vertex, 3 * vertex + 3);
    let piece = pieces[bone];
    if (piece === "waist") piece = z > waist_m ? "shirt" : "trousers";
    if (found.names[bone] === "Head" && z > head_z + (y > head_y ? 0 : BROW_M)) piece = "hair"; // at rest it faces -y
    paint[piece].toArray(shown, 3 * vertex);
  }
  geometry.setAttribute("color", new BufferAttribute(shown, 3));
  geometry.computeVertexNormals();
  return geometry;
}

const turned = (matrix, [x, y, z]) => matrix.map((row) => row[0] * x + row[1] * y + row[2] * z);
const minus = (a, b) => a.map((value, i) => value - b[i]);

export class Dancer {
  constructor(found, kind) {
    const material = new MeshStandardMaterial({ vertexColors: true, roughness: 0.85 });
    this.mesh = new SkinnedMesh(geometryOf(found, COLOURS[kind]), material);
    this.mesh.frustumCulled = false;
    this.bones = found.names.map((name) => {
      const piece = CLOTHES.find(([pattern]) => pattern.test(name))[1], bone = new Bone();
      bone.userData = { ink: COLOURS[kind][piece === "waist" ? "trousers" : piece], head: name === "Head" }; // for `FlatRenderer`
      return bone;
    });
    const inverses = found.names.map((_, bone) => {
      const rotation = found.t_pose[bone], offset = turned(rotation, found.heads_m[bone]);
      return new Matrix4().set(...rotation[0], -offset[0], ...rotation[1], -offset[1], ...rotation[2], -offset[2], 0, 0, 0, 1);
    });
    found.parents.forEach((parent, bone) => {
      if (parent < 0) return this.mesh.add(this.bones[bone]);
      const offset = turned(found.t_pose[parent], minus(found.heads_m[bone], found.heads_m[parent]));
      this.bones[bone].position.set(...offset);
      return this.bones[parent].add(this.bones[bone]);
    });
    this.group = new Group();
    this.group.rotation.x = -Math.PI / 2; // the world of the movements has z up
    this.group.add(this.mesh);
    this.mesh.bind(new Skeleton(this.bones, inverses), new Matrix4());
    this.movement = null;
  }

  show(time_s) {
    const { fps, frames, hips, quats, begin_s } = this.movement;
    const at = clamp((time_s - begin_s) * fps, 0, frames - 1), frame = Math.floor(at), rest = at - frame;
    const next = Math.min(frame + 1, frames - 1), count = this.bones.length;
    for (let bone = 0; bone < count; bone++) {
      const a = 4 * (frame * count + bone), b = 4 * (next * count + bone);
      this.bones[bone].quaternion.set(quats[a + 1], quats[a + 2], quats[a + 3], quats[a]).normalize();
      other.set(quats[b + 1], quats[b + 2], quats[b + 3], quats[b]).normalize();
      this.bones[bone].quaternion.slerp(other, rest);
    }
    const place = [0, 1, 2].map((axis) => hips[3 * frame + axis] * (1 - rest) + hips[3 * next + axis] * rest);
    this.bones[0].position.set(...place);
  }
}
const other = new Quaternion();

// How much a machine can draw. Drawings that it has not finished would queue, and hold up everything that the page shows: the next
// one waits until the one before is finished, and takes no more than its share of the time. How long one takes is measured now and
// then: where it is long, as without a graphics card, pictures get coarser than the screen, where it is short, finer, which smooths
// their edges.
const SHARE = 1 / 3, SLOW_MS = 40, SMOOTH_MS = SHARE * 1000 / 60, STEP = Math.SQRT2, MEASURED_EVERY = 20;

export class DrawingLoad {
  // density: pixels of the screen for each of the page's, devicePixelRatio.
  constructor(gl, density) {
    Object.assign(this, { gl, density: Math.min(density, 2), ratio: Math.min(density, 2), fence: null, drawings: 0, took_ms: 0, next: 0, doubted: false });
  }

  allows(now) {
    if (this.fence !== null) {
      if (this.gl.getSyncParameter(this.fence, this.gl.SYNC_STATUS) === this.gl.UNSIGNALED) return false;
      this.gl.deleteSync(this.fence);
      this.fence = null;
    }
    return now >= this.next;
  }

  drawn(begun) {
    this.drawings += 1;
    if (this.doubted || this.drawings % MEASURED_EVERY === 2) this.measure(begun); // the first one prepares the next ones too
    this.next = begun + this.took_ms / SHARE;
    this.fence = this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    this.gl.flush();
  }

  // A step finer doubles the pixels: it is taken where the drawing, twice as long, is still quick enough.
  measure(begun) {
    const { gl, density } = this;
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits until it is drawn
    const took_ms = performance.now() - begun;
    this.doubted = !this.doubted && took_ms > SLOW_MS && took_ms > 2 * this.took_ms; // the machine may have stalled: once more
    if (this.doubted) return;
    this.took_ms = took_ms;
    if (took_ms > (this.ratio > density ? 2 * SMOOTH_MS : SLOW_MS)) this.ratio = Math.max(this.ratio / STEP, density / STEP);
    else if (2 * took_ms < (this.ratio < density ? SLOW_MS : SMOOTH_MS)) this.ratio = Math.min(this.ratio * STEP, 2 * STEP, 2 * density);
  }
}

const FIELD_DEG = 38, BESIDE_M = 0.7, LEAST_M = 3.8, MOST_M = 30; // a field from top to bottom; beside the outer dancers; from the camera

// How far from the middle a camera of this aspect stands that sees all, who are beside the middle and nearer, x and z in metres.
export function distanceOf(places_m, aspect) {
  const wide = aspect * Math.tan(FIELD_DEG * Math.PI / 360);
  return Math.max(LEAST_M, ...places_m.map(({ x, z }) => z + (Math.abs(x) + BESIDE_M) / wide));
}

function rendererOf(canvas) {
  try {
    return new WebGLRenderer({ canvas, alpha: true });
  } catch { // three.js has told in the console why
    return new FlatRenderer(canvas);
  }
}

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = rendererOf(canvas);
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(FIELD_DEG, 4 / 3, 0.1, 60);
    this.camera.position.set(0, 1.25, 3.6);
    this.controls = new OrbitControls(this.camera, canvas);
    canvas.style.touchAction = "pan-y"; // sideways the view is turned; up and down the page is scrolled, which it may fill
    this.controls.target.set(0, 0.92, 0);
    this.controls.maxPolarAngle = 1.6;
    this.controls.minDistance = 1.5;
    this.controls.maxDistance = 8;
    this.controls.enablePan = false;
    this.controls.addEventListener("change", () => { this.changed = true; });
    this.controls.update();
    this.stage = new Group();
    const sun = new DirectionalLight("#ffffff", 2.2);
    sun.position.set(1.5, 4, 3);
    const floor = new Mesh(new CircleGeometry(1.8, 48), new MeshStandardMaterial({ color: "#777286", roughness: 1 }));
    floor.rotation.x = -Math.PI / 2;
    floor.position.y = -0.002;
    this.scene.add(this.stage, sun, new HemisphereLight("#ffffff", "#666077", 1.6), floor, new GridHelper(3.6, 6, "#55506a", "#66617a"));
    this.dancers = [];
    this.changed = true;
    this.load = this.renderer instanceof FlatRenderer ? new FlatLoad(devicePixelRatio) : new DrawingLoad(this.renderer.getContext(), devicePixelRatio);
  }

  add(found, kind, x) {
    const dancer = new Dancer(found, kind);
    dancer.group.position.x = x;
    this.stage.add(dancer.group);
    this.dancers.push(dancer);
    return dancer;
  }

  mirror(on) {
    this.stage.scale.x = on ? -1 : 1;
    this.changed = true;
  }

  back(distance) {
    this.camera.position.set(0, 1.25, distance);
    this.controls.update();
  }

  // Shows all who stand at these places, see `distanceOf`, however wide the picture is.
  fit(places_m) {
    this.places_m = places_m;
    this.controls.maxDistance = MOST_M;
  }

  turn(angle) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    this.camera.position.copy(this.controls.target).add(offset.applyAxisAngle(this.camera.up, angle));
    this.controls.update();
  }

  draw(time_s) {
    const { clientWidth, clientHeight } = this.canvas, now = performance.now();
    const still = time_s === this.shown && !this.changed && clientWidth === this.width && clientHeight === this.height;
    // WebKit shows a drawing when the next one is made: what stands still is drawn twice.
    if (!clientWidth || !this.load.allows(now) || (still && this.twice)) return;
    this.twice = still;
    if (clientWidth !== this.width || clientHeight !== this.height || this.load.ratio !== this.ratio) {
      [this.width, this.height, this.ratio] = [clientWidth, clientHeight, this.load.ratio];
      this.renderer.setPixelRatio(this.ratio);
      this.renderer.setSize(clientWidth, clientHeight, false);
      const aspect = clientWidth / clientHeight;
      if (this.places_m && this.fitted !== aspect) this.back(distanceOf(this.places_m, aspect)); // else it stays as it was zoomed
      this.camera.aspect = this.fitted = aspect;
      this.camera.updateProjectionMatrix();
    }
    [this.shown, this.changed] = [time_s, false];
    for (const dancer of this.dancers) if (dancer.movement) dancer.show(time_s);
    this.renderer.render(this.scene, this.camera);
    this.load.drawn(now);
  }

  close() {
    this.controls.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}
