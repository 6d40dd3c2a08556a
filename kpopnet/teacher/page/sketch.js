// A small figure of lines from fifteen joints in centimetres, x to the right and y up, as the server sends them.
const LIMBS = [[0, 1], [1, 8], [1, 2], [1, 3], [2, 4], [4, 6], [3, 5], [5, 7], [8, 9], [8, 10], [9, 11], [11, 13], [10, 12], [12, 14]];

// At (x, y) in pixels, `scale` pixels a centimetre.
export function sketch(pen, points, { x, y, scale, ink, mirrored }) {
  const across = mirrored ? -scale : scale, at = (joint) => [x + points[2 * joint] * across, y - points[2 * joint + 1] * scale];
  [pen.strokeStyle, pen.fillStyle, pen.lineWidth, pen.lineCap] = [ink, ink, Math.max(5.8 * scale, 2), "round"];
  pen.beginPath();
  for (const [from, to] of LIMBS) {
    pen.moveTo(...at(from));
    pen.lineTo(...at(to));
  }
  pen.stroke();
  pen.beginPath();
  pen.arc(...at(0), 9.6 * scale, 0, 7);
  pen.fill();
}
