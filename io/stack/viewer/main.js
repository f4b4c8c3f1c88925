
// Pointers, keys and buttons.

const views = {};

// Drag to move, two fingers to zoom, a click without a move to pick. `act` has what a view does then.
function listen(canvas, act) {
  const pointers = new Map();
  let moved = 0, spread = 0;
  const middle = () => {
    const all = [...pointers.values()];
    return { clientX: all.reduce((sum, p) => sum + p.clientX, 0) / all.length, clientY: all.reduce((sum, p) => sum + p.clientY, 0) / all.length };
  };
  const distance = () => {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, event);
    if (pointers.size === 1) moved = 0;
    if (pointers.size === 2) spread = distance();
    if (pointers.size > 1) moved = Infinity;
  });
  canvas.addEventListener("pointermove", (event) => {
    if (act.hover) act.hover(event);
    if (!pointers.has(event.pointerId)) return;
    const before = middle();
    pointers.set(event.pointerId, event);
    const after = middle();
    const by = [after.clientX - before.clientX, after.clientY - before.clientY];
    moved += Math.hypot(...by);
    if (moved < 4) return;
    canvas.parentElement.classList.add("dragging");
    act.drag(...by);
    if (pointers.size === 2) {
      const now = distance();
      if (spread > 0 && now > 0) act.zoom(now / spread, after);
      spread = now;
    }
  });
  const end = (event) => {
    const known = pointers.delete(event.pointerId);
    canvas.parentElement.classList.remove("dragging");
    if (known && event.type === "pointerup" && moved < 4 && act.pick) act.pick(event);
  };
  canvas.addEventListener("pointerup", end);
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("pointerleave", () => { if (act.leave) act.leave(); });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const lines = event.deltaY / (event.deltaMode === 0 ? 60 : 1);
    if (event.ctrlKey || event.metaKey || act.wheelZooms) act.zoom(Math.exp(-lines * 0.25), event);
    else scrub(-lines * (event.shiftKey ? 10 : 1));
  }, { passive: false });
  canvas.addEventListener("dblclick", (event) => act.zoom(4, event));
}

// Parts of slices add up, for wheels that turn smoothly.
let scrubbed = 0;
function scrub(slices) {
  scrubbed += slices;
  const whole = Math.trunc(scrubbed);
  scrubbed -= whole;
  if (whole) setSlice(state.slice + whole);
}

function listenFlat(view) {
  listen(view.canvas, {
    drag: (x, y) => view.pan(x, y),
    zoom: (factor, event) => view.zoomAt(factor, event),
    pick: (event) => view.pick(view.place(event)),
    hover: view === sliceView && ((event) => {
      const [u, v] = view.place(event);
      pointed = [Math.floor(u / dx), Math.floor(v / dy)];
      showReadout();
    }),
    leave: view === sliceView && (() => {
      pointed = null;
      showReadout();
    }),
  });
}

const THEMES = ["system", "light", "dark"];
let theme = "system";
const darkSystem = matchMedia("(prefers-color-scheme: dark)");
function setTheme(name) {
  theme = name;
  const dark = name === "dark" || name === "system" && darkSystem.matches;
  document.documentElement.dataset.theme = dark ? "dark" : "light";
  $("theme").textContent = { system: "◐", light: "☀", dark: "☾" }[name];
  $("theme").setAttribute("aria-label", `Theme: ${name === "system" ? "as the system" : name}`);
  tell("theme");
}

const next = (list, now) => list[(list.indexOf(now) + 1) % list.length];

// Single voxels, at the cursor.
function showVoxels() {
  state.centre = [(state.cursor[0] + 0.5) * dx, (state.cursor[1] + 0.5) * dy, (state.slice + 0.5) * thickness];
  const view = views[state.main] === views.solid ? sliceView : views[state.main];
  setZoom(state.zoom * 24 * (window.devicePixelRatio || 1) / (view.scale * Math.min(...view.pitch)));
}

function showAll() {
  state.centre = size_mm.map((length) => length / 2);
  views.solid.zoom = 1;
  setZoom(1);
}

function pressed(key, shift) {
  const view = views[state.main] === views.solid ? sliceView : views[state.main];
  const solid = document.activeElement === views.solid.canvas;
  const step = shift ? 10 : 1;
  const move = (x, y) => solid ? views.solid.turned(x * 12 * step, y * 12 * step) : view.pan(-x * 30 * step, -y * 30 * step);
  const actions = {
    ArrowUp: () => solid ? move(0, 1) : setSlice(state.slice + step),
    ArrowDown: () => solid ? move(0, -1) : setSlice(state.slice - step),
    ArrowLeft: () => move(-1, 0),
    ArrowRight: () => move(1, 0),
    PageUp: () => setSlice(state.slice + 16),
    PageDown: () => setSlice(state.slice - 16),
    Home: () => setSlice(0),
    End: () => setSlice(sliceCount - 1),
    "+": () => setZoom(state.zoom * 1.25),
    "=": () => setZoom(state.zoom * 1.25),
    "-": () => setZoom(state.zoom / 1.25),
    0: showAll,
    z: showVoxels,
    d: () => setMode(next(page.stacks.length > 1 ? ["materials", "below", "against"] : ["materials", "below"], state.mode)),
    v: () => setMain(next(["xy", "xz", "yz", "solid"], state.main)),
    x: () => setCut(!state.cut),
    t: () => setTheme(next(THEMES, theme)),
    "?": () => $("keys").showModal(),
  };
  if (/^[1-9]$/.test(key) && key <= values) actions[key] = () => setMaterial(key - 1, !state.shown[key - 1]);
  const action = actions[key.length === 1 ? key.toLowerCase() : key];
  if (action) action();
  return Boolean(action);
}

function setCut(cut) {
  state.cut = cut;
  $("cut").checked = cut;
  views.solid.draw();
}

function listenPage() {
  document.addEventListener("keydown", (event) => {
    const target = event.target;
    const typing = target.matches("input[type=number], select") || $("keys").open;
    const sliding = target.id === "slice" && /^(Arrow|Page|Home|End)/.test(event.key);
    if (typing || sliding || event.ctrlKey || event.metaKey || event.altKey) return;
    if (pressed(event.key, event.shiftKey)) event.preventDefault();
  });
  $("slice").addEventListener("input", (event) => setSlice(Number(event.target.value)));
  $("number").addEventListener("change", (event) => {
    setSlice(Number(event.target.value) / page.stride);
    showSlice();
  });
  $("up").addEventListener("click", () => setSlice(state.slice + 1));
  $("down").addEventListener("click", () => setSlice(state.slice - 1));
  $("mode").addEventListener("change", (event) => setMode(event.target.value));
  $("cut").addEventListener("change", (event) => setCut(event.target.checked));
  $("theme").addEventListener("click", () => setTheme(next(THEMES, theme)));
  $("help").addEventListener("click", () => $("keys").showModal());
  darkSystem.addEventListener("change", () => setTheme(theme));
  for (const view of document.querySelectorAll(".view"))
    view.querySelector(".enlarge").addEventListener("click", () => setMain(view.id.replace("view-", "")));
}

// A voxel of the fullest place: where the middle is empty, the cursor would show nothing.
async function placeCursor() {
  await volumeReady;
  let best = -1;
  for (let i = 0; i < volume.share.length; ++i) {
    if (volume.share[i] < 255) continue;
    const place = [i % cells[0], Math.floor(i / cells[0]) % cells[1], Math.floor(i / cells[0] / cells[1])];
    const off = Math.hypot(...place.map((cell, axis) => cell / cells[axis] - 0.5));
    if (best < 0 || off < best) {
      best = off;
      state.cursor = [dx, dy].map((pitch, axis) =>
          clamp(Math.floor((place[axis] + 0.5) * page.volume.cell_mm / pitch), 0, page.size[axis] - 1));
      state.slice = clamp(Math.floor((place[2] + 0.5) * page.volume.cell_mm / thickness), 0, sliceCount - 1);
    }
  }
}

async function start() {
  fillPage();
  fillMaterials();
  fillKeys();
  setTheme("system");
  await placeCursor();
  sliceView = views.xy = new SliceView();
  front = views.xz = new SectionView("xz", "front");
  side = views.yz = new SectionView("yz", "side");
  views.solid = new SolidView();
  for (const view of [sliceView, front, side]) listenFlat(view);
  listen(views.solid.canvas, {
    drag: (x, y) => views.solid.turned(x, y),
    zoom: (factor) => {
      views.solid.zoom = clamp(views.solid.zoom * factor, 0.3, 20);
      views.solid.draw();
    },
    wheelZooms: true,
  });
  listenPage();
  when(["slice"], showSlice);
  when(["look"], showWholeCounts);
  when(["cursor", "slice"], showReadout);
  showSlice();
  document.body.dataset.ready = "";
}

// For tests, and for those who write their own scripts around the page.
window.viewer = {
  page, state, setSlice, setCursor, setMode, setMaterial, setMain, setZoom, setTheme, showVoxels, showAll,
  // The values of the voxels of a slice, row by row, from the top.
  valuesOf: async (stack, slice) => {
    const { crop, plane } = await sliceOf(stack, slice);
    return Array.from({ length: height }, (_, y) => Array.from({ length: width }, (__, x) => crop.value(plane, x, y)));
  },
  // Whether the sections show what is in sight as it is at the cursor.
  sectionsRead: () => state.cursor.every((place, axis) => place === sections.cursor[axis]) && [front, side].every((view) => {
    const [begin, end] = view.range().map((slice) => slice / SLICES_OF_GROUP);
    return view.picture && view.picture.reading === sections.readings && sections.known.slice(begin, Math.ceil(end)).every(Boolean);
  }),
  // The pixel of a canvas at the middle of a voxel: of its column and its row, or its slice.
  pixelOf: (name, across, along) => {
    const view = views[name];
    return view.toCanvas((across + 0.5) * view.pitch[0], (along + 0.5) * view.pitch[1]).map(Math.floor);
  },
};

start().catch((reason) => {
  $("name").textContent = "Slices";
  $("warning").textContent = `This browser cannot show the page: ${reason.message}. It needs DecompressionStream and OffscreenCanvas.`;
  $("warning").hidden = false;
  console.error(reason);
});
