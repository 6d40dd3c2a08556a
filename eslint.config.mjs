// Of the dance teacher's page: `npx eslint` (npm install eslint); `make lint` runs it where it is installed.
const BROWSER = [
  "AbortController", "AbortSignal", "addEventListener", "alert", "atob", "AudioContext", "clearInterval", "clearTimeout",
  "createImageBitmap", "devicePixelRatio", "document", "Event", "EventTarget", "fetch", "getComputedStyle", "history",
  "HTMLCanvasElement", "importScripts", "IntersectionObserver", "localStorage", "location", "matchMedia", "navigator",
  "OfflineAudioContext", "OffscreenCanvas", "performance", "queueMicrotask", "ReadableStream", "requestAnimationFrame",
  "Response", "setInterval", "setTimeout", "TextDecoder", "TextEncoder", "URL", "URLSearchParams", "WebSocket", "Worker",
];

export default [
  { ignores: ["**/vendor/**", ".venv/**", "outputs/**", "data/**"] },
  {
    files: ["kpopnet/teacher/page/*.js", "tests/kpopnet/teacher/page/*.mjs"],
    languageOptions: {
      ecmaVersion: 2022,
      sourceType: "module",
      globals: Object.fromEntries([...BROWSER, "btoa", "globalThis"].map((name) => [name, "readonly"])),
    },
    linterOptions: { reportUnusedDisableDirectives: "error" },
    rules: {
      "array-callback-return": "error",
      "consistent-return": "error",
      "constructor-super": "error",
      "eqeqeq": "error",
      "no-const-assign": "error",
      "no-constant-condition": "error",
      "no-dupe-keys": "error",
      "no-duplicate-imports": "error",
      "no-eval": "error",
      "no-fallthrough": "error",
      "no-implied-eval": "error",
      "no-redeclare": "error",
      "no-self-assign": "error",
      "no-undef": "error",
      "no-unreachable": "error",
      "no-unsafe-finally": "error",
      "no-unused-vars": "error",
      "no-use-before-define": ["error", { functions: false, classes: false, variables: false }],
      "no-var": "error",
      "prefer-const": "error",
      "semi": "error",
      "use-isnan": "error",
      "valid-typeof": "error",
    },
  },
];
