
// The picture of the slice, and sections through all of them.

// Colours of the values of a slice, as bytes in the order of a canvas; hidden ones and 0 have none.
function palette() {
  const colours = new Uint32Array(256);
  state.shown.forEach((shown, index) => {
    if (shown) colours[index + 1] = packedColour(rgbOf(index));
  });
  return colours;
}

const visible = (value) => value > 0 && state.shown[value - 1];

// Colours by the values before (row) and now (column): what a difference shows.
function differenceColours() {
  const table = new Uint32Array(65536);
  for (let before = 0; before <= values; ++before) {
    for (let now = 0; now <= values; ++now) {
      const was = visible(before), is = visible(now);
      const kind = !was && !is ? null : !was ? "added" : !is ? "removed" : before !== now ? "changed" : "same";
      if (kind) table[before << 8 | now] = packedColour(DIFFERENCE[kind]);
    }
  }
  return table;
}

// The slice that is shown, and the one that it is compared with.
async function shownSlices(number) {
  switch (state.mode) {
    case "below": return [await sliceOf(0, number), await sliceOf(0, number - 1)];
    case "against": return [await sliceOf(0, number), await sliceOf(1, number)];
    case "other": return [await sliceOf(1, number), null];
    default: return [await sliceOf(0, number), null];
  }
}

function boxOf(...slices) {
  let left = width, top = height, right = 0, bottom = 0;
  for (const slice of slices) {
    if (!slice || slice.crop.width === 0) continue;
    left = Math.min(left, slice.crop.left);
    top = Math.min(top, slice.crop.top);
    right = Math.max(right, slice.crop.left + slice.crop.width);
    bottom = Math.max(bottom, slice.crop.top + slice.crop.height);
  }
  return right > left ? { left, top, right, bottom } : { left: 0, top: 0, right: 0, bottom: 0 };
}

// A picture of at most so many pixels is made of a slice at once.
const MOST_PIXELS = 16 << 20;

// The picture of the voxels in `wanted`, or of all of them where that is not too much.
function pictureOf([now, before], wanted) {
  let box = boxOf(now, before);
  const area = () => (box.right - box.left) * (box.bottom - box.top);
  const whole = area() <= MOST_PIXELS;
  if (!whole) {
    box = { left: Math.max(box.left, wanted.left), top: Math.max(box.top, wanted.top),
            right: Math.min(box.right, wanted.right), bottom: Math.min(box.bottom, wanted.bottom) };
    if (box.right <= box.left || box.bottom <= box.top) box = { left: 0, top: 0, right: 0, bottom: 0 };
  }
  const step = Math.max(1, Math.ceil(Math.sqrt(area() / MOST_PIXELS)));
  const columns = Math.ceil((box.right - box.left) / step), rows = Math.ceil((box.bottom - box.top) / step);
  if (columns === 0 || rows === 0) return { ...box, step, whole, canvas: null };
  const canvas = new OffscreenCanvas(columns, rows);
  const context = canvas.getContext("2d");
  const image = context.createImageData(columns, rows);
  const pixels = new Uint32Array(image.data.buffer);
  const colours = before ? differenceColours() : palette();
  for (let row = 0, to = 0; row < rows; ++row) {
    const y = box.top + row * step;
    if (!before && step === 1) {
      for (let i = now.crop.at(box.left, y), end = i + columns; i < end; ++i) pixels[to++] = colours[now.plane[i]];
      continue;
    }
    for (let column = 0; column < columns; ++column, ++to) {
      const x = box.left + column * step;
      const value = now.crop.value(now.plane, x, y);
      pixels[to] = before ? colours[before.crop.value(before.plane, x, y) << 8 | value] : colours[value];
    }
  }
  context.putImageData(image, 0, 0);
  return { ...box, step, whole, canvas };
}

// Voxels of each value, and of each kind of difference.
function countsOf([now, before]) {
  const counts = new Array(values).fill(0);
  const { crop, plane } = now;
  for (let y = 0; y < crop.height; ++y) {
    const begin = (y + 1) * crop.stride + 8;
    for (let i = begin; i < begin + crop.width; ++i) if (plane[i]) ++counts[plane[i] - 1];
  }
  if (!before) return { counts, difference: null };
  const difference = { added: 0, removed: 0, changed: 0 };
  const box = boxOf(now, before);
  for (let y = box.top; y < box.bottom; ++y) {
    for (let x = box.left; x < box.right; ++x) {
      const is = crop.value(plane, x, y), was = before.crop.value(before.plane, x, y);
      if (is !== was) ++difference[was === 0 ? "added" : is === 0 ? "removed" : "changed"];
    }
  }
  return { counts, difference };
}

// The volume of cubes that the page holds: share and value of each, and the colours of blocks of eight.
const cells = page.volume.cells;
let volume = null;
const volumeReady = inflated(bytesOf("volume")).then((bytes) => {
  const count = cells[0] * cells[1] * cells[2];
  volume = { share: bytes.subarray(0, count), value: bytes.subarray(count, 2 * count), colour: bytes.subarray(2 * count) };
});

// Lines of the slices through the cursor: along x for the front, along y for the side. They are read while nobody waits.
const sections = {
  cursor: null, stack: -1, front: null, side: null, known: null, run: 0, readings: 0,
  reset(stack) {
    if (this.cursor && this.cursor[0] === state.cursor[0] && this.cursor[1] === state.cursor[1] && this.stack === stack) return;
    this.cursor = [...state.cursor];
    this.stack = stack;
    this.front = new Uint8Array(width * sliceCount);
    this.side = new Uint8Array(height * sliceCount);
    this.known = new Uint8Array(Math.ceil(sliceCount / SLICES_OF_GROUP));
  },
  take(index, group) {
    const [x, y] = this.cursor, { crop } = group;
    group.planes.forEach((plane, i) => {
      const slice = index * SLICES_OF_GROUP + i;
      if (y >= crop.top && y < crop.top + crop.height)
        this.front.set(plane.subarray(crop.at(crop.left, y), crop.at(crop.left, y) + crop.width), slice * width + crop.left);
      if (x >= crop.left && x < crop.left + crop.width)
        for (let row = crop.top; row < crop.top + crop.height; ++row)
          this.side[slice * height + row] = plane[crop.at(x, row)];
    });
    this.known[index] = 1;
  },
  // Reads the slices from `begin` to `end`, those near the present one first. Calls `done` now and then.
  async read(begin, end, done) {
    const run = ++this.run;
    const present = Math.floor(state.slice / SLICES_OF_GROUP);
    const wanted = [];
    for (let i = Math.floor(begin / SLICES_OF_GROUP); i * SLICES_OF_GROUP < end; ++i) if (!this.known[i]) wanted.push(i);
    wanted.sort((a, b) => Math.abs(a - present) - Math.abs(b - present));
    // Slices that are asked for go first.
    const rest = async () => {
      do await pause(); while (sliceView.isBusy());
      if (run !== this.run) throw STOPPED;
    };
    let told = performance.now();
    try {
      for (const index of wanted) {
        await rest();
        const kept = cache.get(`${this.stack}-${index}`);
        const group = kept && kept.group ? kept.group
            : this.stack === 0 ? await unpackGroup(0, index, null, rest) : await groupOf(this.stack, index);
        if (run !== this.run) return;
        this.take(index, group);
        if (performance.now() - told > 400) {
          done();
          told = performance.now();
        }
      }
    } catch (reason) {
      if (reason !== STOPPED) throw reason;
      return;
    }
    if (wanted.length) done();
  },
};
const STOPPED = Symbol("stopped");

// A section as a picture: exact where its lines are known, else from the volume. Top row: the highest slice of the range.
// A pixel stands for `across` columns and `along` slices.
function sectionPicture(axis, begin, end, across, along) {
  const length = axis === "front" ? width : height;
  const columns = Math.ceil(length / across), lines = Math.ceil((end - begin) / along);
  const canvas = new OffscreenCanvas(columns, lines);
  const context = canvas.getContext("2d");
  const image = context.createImageData(columns, lines);
  const pixels = new Uint32Array(image.data.buffer);
  const colours = palette();
  const source = axis === "front" ? sections.front : sections.side;
  // Seen from the right, the first column is the row of the least y.
  const places = Int32Array.from({ length: columns }, (_, column) => axis === "front" ? column * across : height - 1 - column * across);
  const coarse = coarseColumns(axis, places);
  for (let line = 0, to = 0; line < lines; ++line) {
    const slice = end - 1 - line * along;
    const known = sections.known[Math.floor(slice / SLICES_OF_GROUP)];
    const layer = Math.min(Math.floor((slice + 0.5) * thickness / page.volume.cell_mm), cells[2] - 1) * cells[0] * cells[1];
    for (let column = 0; column < columns; ++column, ++to) {
      if (known) pixels[to] = colours[source[slice * length + places[column]]];
      else if (coarse && volume.share[layer + coarse[column]] > 127) pixels[to] = colours[volume.value[layer + coarse[column]]];
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

// For each place along a section, its cell in a layer of the volume.
function coarseColumns(axis, places) {
  if (!volume || state.mode === "other") return null;
  const cell = (at, pitch, i) => Math.min(Math.floor((at + 0.5) * pitch / page.volume.cell_mm), cells[i] - 1);
  const [x, y] = sections.cursor;
  return places.map((at) => axis === "front" ? cell(y, dy, 1) * cells[0] + cell(at, dx, 0)
                                             : cell(at, dy, 1) * cells[0] + cell(x, dx, 0));
}
