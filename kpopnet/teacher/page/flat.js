// What a `View` draws where the browser has no WebGL, as on many machines without a graphics card: bones and the floor as lines.
import { Vector3 } from "./vendor/three.js";

const LIMB_M = 0.09, EDGE_M = 0.012, HEAD_M = 0.11;

export class FlatRenderer {
  constructor(canvas) {
    Object.assign(this, { canvas, pen: canvas.getContext("2d"), ratio: 1 });
  }

  setPixelRatio(ratio) {
    this.ratio = ratio;
  }

  setSize(width, height) {
    [this.canvas.width, this.canvas.height] = [width, height].map((side) => Math.floor(this.ratio * side));
  }

  render(scene, camera) {
    scene.updateMatrixWorld();
    camera.updateMatrixWorld();
    const { width, height } = this.canvas, { pen } = this, strokes = [];
    // A point in pixels, how many of them a metre takes there, and its distance in metres; null behind the camera.
    const seen = (place) => {
      const far_m = -place.clone().applyMatrix4(camera.matrixWorldInverse).z, { x, y } = place.clone().project(camera);
      return far_m < camera.near ? null : { x: width * (1 + x) / 2, y: height * (1 - y) / 2, metre: camera.projectionMatrix.elements[5] * height / 2 / far_m, far_m };
    };
    const line = (from, to, wide_m, ink, opacity = 1) => {
      const [a, b] = [seen(from), seen(to)];
      if (a && b) strokes.push({ a, b, wide: wide_m * (a.metre + b.metre) / 2, ink, opacity, far_m: (a.far_m + b.far_m) / 2 });
    };
    const at = (node, x = 0, y = 0, z = 0) => new Vector3(x, y, z).applyMatrix4(node.matrixWorld);
    scene.traverseVisible((node) => {
      if (node.isBone && node.parent.isBone) line(at(node.parent), at(node), LIMB_M, node.parent.userData.ink);
      if (node.userData.head) line(at(node), at(node), 2 * HEAD_M, node.userData.ink);
      if (node.userData.solid) {
        const [x, y, z] = node.scale, ball = node.userData.solid === "ball", ink = `#${node.material.color.getHexString()}`;
        line(at(node), ball ? at(node) : at(node, 0, 1), ball ? 2 * y : x + z, ink, node.material.opacity);
      }
      if (node.isLineSegments) {
        const places = node.geometry.getAttribute("position");
        for (let k = 0; k < places.count; k += 2) line(...[k, k + 1].map((one) => at(node, places.getX(one), places.getY(one), places.getZ(one))), EDGE_M, "#777286");
      }
    });
    pen.clearRect(0, 0, width, height);
    pen.lineCap = "round";
    for (const { a, b, wide, ink, opacity } of strokes.sort((one, other) => other.far_m - one.far_m)) {
      [pen.strokeStyle, pen.lineWidth, pen.globalAlpha] = [ink, Math.max(wide, 1), opacity];
      pen.beginPath();
      pen.moveTo(a.x, a.y);
      pen.lineTo(b.x, b.y);
      pen.stroke();
    }
  }

  dispose() {}

  forceContextLoss() {}
}

// Lines are soon drawn; see `DrawingLoad`.
export class FlatLoad {
  constructor(density) {
    this.ratio = Math.min(density, 2);
  }

  allows() {
    return true;
  }

  drawn() {}
}
