
// What is shown, and who wants to know when it changes.

const $ = (id) => document.getElementById(id);
const clamp = (value, least, most) => Math.min(Math.max(value, least), most);
const size_mm = [width * dx, height * dy, layers * dz];

const state = {
  slice: 0,
  mode: "materials",            // or "below", "against", "other"
  shown: page.materials.map(() => true),
  cursor: [width >> 1, height >> 1],  // column and row
  centre: [size_mm[0] / 2, size_mm[1] / 2, size_mm[2] / 2],  // mm from the left, from the top row down, from the bottom up
  zoom: 1,                      // 1: all of the part is in view
  main: "xy",
  cut: false,
};

// What changes together is told once, before the next frame.
const listeners = { slice: [], look: [], view: [], cursor: [], theme: [] };
const changed = new Set();
function tell(...what) {
  if (changed.size === 0) requestAnimationFrame(() => {
    const told = [...changed];
    changed.clear();
    for (const listener of new Set(told.flatMap((name) => listeners[name]))) listener();
  });
  for (const name of what) changed.add(name);
}
function when(names, listener) {
  for (const name of names) listeners[name].push(listener);
}

// The absolute layer of a slice, and the lattice's index of a column and a row.
const layerOf = (slice) => page.first[2] + slice * page.stride;
const columnIndex = (x) => page.first[0] + x;
const rowIndex = (y) => page.first[1] + height - 1 - y;
const thickness = dz * page.stride;

function setSlice(slice) {
  slice = clamp(Math.round(slice), 0, sliceCount - 1);
  if (slice === state.slice) return;
  state.slice = slice;
  tell("slice");
}

function setCursor(x, y) {
  state.cursor = [clamp(Math.floor(x), 0, width - 1), clamp(Math.floor(y), 0, height - 1)];
  tell("cursor");
}

function setMaterial(index, shown) {
  state.shown[index] = shown;
  $("materials").querySelectorAll("input")[index].checked = shown;
  tell("look");
}

function setMode(mode) {
  state.mode = mode;
  $("mode").value = mode;
  tell("look");
}

const MOST_ZOOM = 4000;
function setZoom(zoom) {
  state.zoom = clamp(zoom, 0.5, MOST_ZOOM);
  tell("view");
}

function setMain(name) {
  state.main = name;
  for (const view of document.querySelectorAll(".view")) view.classList.toggle("main", view.id === `view-${name}`);
  tell("view");
}

// Colours of canvases come from the style sheet, which knows the theme.
const styleColour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

const rgbOf = (index) => page.materials[index].rgba.slice(0, 3);
const packedColour = ([red, green, blue]) => (255 << 24 | blue << 16 | green << 8 | red) >>> 0;

const DIFFERENCE = {
  added: [43, 158, 88],
  removed: [222, 72, 72],
  changed: [139, 92, 246],
  same: [150, 158, 168],
};
