// Views without pictures in 3D, which keep what they are asked to show; imported before the modules of the page.
import { register } from "node:module";

const script = (text) => `data:text/javascript,${encodeURIComponent(text)}`;
const WITHOUT_3D = script(`
export const loadBody = async () => ({}), movementOf = (one) => one, views = [];
export class View {
  constructor(canvas) {
    Object.assign(this, { canvas, dancers: [], turned: 0, stage: { add() {} }, controls: { addEventListener() {} } });
    views.push(this);
  }
  add() {
    this.dancers.push({ group: { position: {} }, mesh: { material: {} } });
    return this.dancers.at(-1);
  }
  mirror(on) { this.mirrored = on; }
  turn(angle) { this.turned += angle; }
  draw(time_s) {
    this.time_s = time_s;
    for (const dancer of this.dancers) dancer.show?.(time_s);
  }
  close() { this.closed = true; }
  fit() {} back() {}
}`);
register(script(`export const resolve = async (name, context, next) =>
  (name.endsWith("/body.js") ? { url: ${JSON.stringify(WITHOUT_3D)}, shortCircuit: true } : next(name, context));`));
