// As much of a browser's document as building a view needs; imported before the modules of the page.
class Node {
  constructor(tag) {
    Object.assign(this, { tag, style: { setProperty() {} }, dataset: {}, children: [], listeners: {}, textContent: "", value: "", paused: true });
    Object.assign(this, { isConnected: true, classList: { toggle() {} } });
  }

  get options() {
    return this.children;
  }

  append(...children) {
    this.children.push(...children);
    this.textContent += children.filter((child) => typeof child === "string").join("");
  }

  replaceChildren(...children) {
    this.children = [];
    this.append(...children);
  }

  setAttribute(name, value) {
    this[name] = value;
  }

  addEventListener(kind, listener) {
    const before = this.listeners[kind];
    this.listeners[kind] = before ? (event) => { before(event); return listener(event); } : listener;
  }

  // By "#identity" alone.
  querySelector(selector) {
    return allOf(this).find(({ id }) => `#${id}` === selector) || null;
  }

  querySelectorAll() {
    return [];
  }

  closest() {
    return new Node("li");
  }

  getBoundingClientRect() {
    return { left: 0, right: 1, top: 0, bottom: 1 };
  }

  click() {
    this.listeners.click?.({ detail: 1 });
  }

  getContext() {
    return new Proxy({}, { get: () => () => {} }); // nothing is drawn
  }

  focus() {
    document.activeElement = this;
  }

  blur() {}

  scrollIntoView() {}
}

// A node's descendants.
export const allOf = (node) => node.children.filter((child) => child instanceof Node).flatMap((child) => [child, ...allOf(child)]);

const stored = new Map();
globalThis.HTMLCanvasElement = Node;
globalThis.document = {
  createElement: (tag) => new Node(tag), createElementNS: (_space, tag) => new Node(tag), getElementById: () => new Node("p"),
  body: new Node("body"), documentElement: new Node("html"),
};
globalThis.localStorage = { getItem: (name) => stored.get(name) ?? null, setItem: (name, value) => stored.set(name, value) };
