// The learner's picture: depth in greys or a webcam's canvas, and the skeleton whose parts are as bright as they are right.
import { remembered, shade } from "./tools.js";

const HEAD = 0, NECK = 1, TORSO = 8;
export const BONES = [
  ["torso", HEAD, NECK], ["torso", NECK, TORSO], ["torso", NECK, 2], ["torso", NECK, 3], ["torso", TORSO, 9], ["torso", TORSO, 10],
  ["right arm", 2, 4], ["right arm", 4, 6], ["left arm", 3, 5], ["left arm", 5, 7],
  ["right leg", 9, 11], ["right leg", 11, 13], ["left leg", 10, 12], ["left leg", 12, 14],
];
const NEAR_M = 0.5, FAR_M = 5.5;
const BODY_M = 0.7;
const UNSURE = 0.25;

export class LearnerView {
  constructor(canvas) {
    this.canvas = canvas;
    this.small = document.createElement("canvas");
  }

  show(picture, frame, mirrored) {
    const people = (frame.people || [frame]).filter(({ joints }) => joints);
    const image = picture instanceof HTMLCanvasElement ? picture : this.depthImage(picture, people), { width, height } = image;
    const scale = Math.min(devicePixelRatio, 2);
    const canvas = this.canvas, draw = canvas.getContext("2d");
    const [wide, high] = [canvas.clientWidth * scale, canvas.clientHeight * scale];
    if (canvas.width !== Math.round(wide) || canvas.height !== Math.round(high)) {
      [canvas.width, canvas.height] = [Math.round(wide), Math.round(high)];
    }
    const zoom = Math.min(canvas.width / width, canvas.height / height);
    draw.setTransform(1, 0, 0, 1, 0, 0);
    draw.clearRect(0, 0, canvas.width, canvas.height);
    draw.translate((canvas.width - zoom * width) / 2, (canvas.height - zoom * height) / 2);
    if (mirrored) draw.transform(-1, 0, 0, 1, zoom * width, 0);
    draw.drawImage(image, 0, 0, zoom * width, zoom * height);
    for (const person of people) this.drawSkeleton(draw, person, zoom * width, zoom * height);
  }

  depthImage(picture, people) {
    const [width, height] = new Uint16Array(picture.buffer.slice(picture.byteOffset, picture.byteOffset + 4));
    const pixels = picture.subarray(4), torsos_m = people.map(({ joints }) => joints[TORSO][2]).filter((z) => z !== null);
    [this.small.width, this.small.height] = [width, height];
    const draw = this.small.getContext("2d"), image = draw.createImageData(width, height);
    for (let i = 0; i < pixels.length; i++) {
      if (pixels[i] === 0) continue;
      const depth_m = NEAR_M + (pixels[i] - 1) / 254 * (FAR_M - NEAR_M);
      const near = torsos_m.some((torso_m) => Math.abs(depth_m - torso_m) < BODY_M);
      const grey = 150 - 25 * depth_m;
      image.data[4 * i] = near ? grey + 10 : grey * 0.55;
      image.data[4 * i + 1] = near ? grey + 14 : grey * 0.55;
      image.data[4 * i + 2] = near ? grey + 40 : grey * 0.65;
      image.data[4 * i + 3] = 255;
    }
    draw.putImageData(image, 0, 0);
    return this.small;
  }

  // person: joints, and the similarities of the parts or one colour.
  drawSkeleton(draw, person, width, height) {
    const safe = remembered("palette", "brightness") === "safe";
    draw.lineCap = "round";
    for (const [part, from, to] of BONES) {
      const a = person.joints[from], b = person.joints[to];
      if ([a[0], a[1], b[0], b[1]].some((value) => value === null)) continue;
      const value = person.parts?.[part];
      draw.globalAlpha = Math.min(a[3], b[3]) < UNSURE ? 0.45 : 1;
      for (const [colour, thickness] of [[person.outline || "#0009", person.outline ? 0.036 : 0.030], [person.colour || shade(value), 0.020]]) {
        draw.strokeStyle = colour;
        // In the other palette what is wrong is thicker too: it does not rest on colour alone.
        draw.lineWidth = height * (thickness + (safe && value < 50 ? 0.012 : 0));
        draw.beginPath();
        draw.moveTo(a[0] * width, a[1] * height);
        draw.lineTo(b[0] * width, b[1] * height);
        draw.stroke();
      }
    }
    draw.globalAlpha = 1;
    const head = person.joints[HEAD];
    if (head[0] !== null) {
      draw.fillStyle = person.colour || person.outline || shade(person.parts.torso);
      draw.beginPath();
      draw.arc(head[0] * width, head[1] * height, 0.03 * height, 0, 7);
      draw.fill();
    }
  }
}
