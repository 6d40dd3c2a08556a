// What this browser remembers between visits.

export function remembered(name, otherwise) {
  try {
    const stored = localStorage.getItem(`teach.${name}`);
    return stored === null ? otherwise : JSON.parse(stored);
  } catch {
    return otherwise;
  }
}

export function remember(name, value) {
  try {
    localStorage.setItem(`teach.${name}`, JSON.stringify(value));
  } catch {
    // A browser that stores nothing forgets.
  }
}
