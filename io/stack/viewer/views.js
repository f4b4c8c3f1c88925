
// The three flat views. Each shows a plane in mm: u to the right and v downwards.

const VIEWS = {
  xy: { u: 0, v: 1, flip: [false, false], pitch: [dx, dy] },
  xz: { u: 0, v: 2, flip: [false, true], pitch: [dx, thickness] },
  yz: { u: 1, v: 2, flip: [true, true], pitch: [dy, thickness] },
};

class FlatView {
  constructor(name) {
    Object.assign(this, VIEWS[name], { name });
    this.canvas = $(`view-${name}`).querySelector("canvas");
    this.context = this.canvas.getContext("2d", { willReadFrequently: false });
    this.extent = [size_mm[this.u], size_mm[this.v]];
    this.picture = null;
    new ResizeObserver(() => this.resize()).observe(this.canvas);
  }
  resize() {
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.max(1, Math.round(this.canvas.clientWidth * ratio));
    this.canvas.height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    this.changed();
  }
  // Pixels of the canvas per mm.
  get scale() {
    const fit = Math.min((this.canvas.width - 28) / this.extent[0], (this.canvas.height - 64) / this.extent[1]);
    return Math.max(fit, 1e-6) * state.zoom;
  }
  // From the state's mm to those of the plane, and back.
  plane(place, axis) {
    return this.flip[axis] ? this.extent[axis] - place : place;
  }
  get centre() {
    return [this.plane(state.centre[this.u], 0), this.plane(state.centre[this.v], 1)];
  }
  toCanvas(u, v) {
    const [cu, cv] = this.centre;
    return [(u - cu) * this.scale + this.canvas.width / 2, (v - cv) * this.scale + this.canvas.height / 2];
  }
  fromCanvas(x, y) {
    const [cu, cv] = this.centre;
    return [(x - this.canvas.width / 2) / this.scale + cu, (y - this.canvas.height / 2) / this.scale + cv];
  }
  place(event) {
    const box = this.canvas.getBoundingClientRect();
    return this.fromCanvas((event.clientX - box.left) * this.canvas.width / box.width,
                           (event.clientY - box.top) * this.canvas.height / box.height);
  }
  pan(du, dv) {
    const ratio = this.canvas.width / this.canvas.clientWidth;
    const move = (axis, by, flipped) => {
      state.centre[axis] = clamp(state.centre[axis] - (flipped ? -by : by) * ratio / this.scale, 0, size_mm[axis]);
    };
    move(this.u, du, this.flip[0]);
    move(this.v, dv, this.flip[1]);
    tell("view");
  }
  zoomAt(factor, event) {
    const before = this.place(event);
    setZoom(state.zoom * factor);
    const after = this.place(event);
    for (const axis of [0, 1]) {
      const state_axis = axis === 0 ? this.u : this.v;
      const by = before[axis] - after[axis];
      state.centre[state_axis] = clamp(state.centre[state_axis] + (this.flip[axis] ? -by : by), 0, size_mm[state_axis]);
    }
  }
  // The range of voxels in sight.
  sight() {
    const [u0, v0] = this.fromCanvas(0, 0), [u1, v1] = this.fromCanvas(this.canvas.width, this.canvas.height);
    return { left: Math.floor(u0 / this.pitch[0]), top: Math.floor(v0 / this.pitch[1]),
             right: Math.ceil(u1 / this.pitch[0]), bottom: Math.ceil(v1 / this.pitch[1]) };
  }
  // Draws a picture whose pixels are `across` by `along` voxels, from column `left` and row `top` on.
  drawPicture(picture, left, top, across, along) {
    const { context, pitch } = this;
    const [x, y] = this.toCanvas(left * pitch[0], top * pitch[1]);
    const w = picture.width * across * pitch[0] * this.scale, h = picture.height * along * pitch[1] * this.scale;
    context.imageSmoothingEnabled = this.scale * Math.min(pitch[0] * across, pitch[1] * along) < 1;
    context.imageSmoothingQuality = "high";
    context.drawImage(picture, x, y, w, h);
  }
  clear() {
    this.context.setTransform(1, 0, 0, 1, 0, 0);
    this.context.fillStyle = styleColour("--stage");
    this.context.fillRect(0, 0, this.canvas.width, this.canvas.height);
  }
  // Lines between voxels, once these are large.
  drawGrid() {
    const { context, pitch, canvas } = this;
    const across = pitch[0] * this.scale, along = pitch[1] * this.scale;
    if (Math.min(across, along) < 9) return;
    const sight = this.sight();
    context.beginPath();
    for (let i = Math.max(0, sight.left); i <= Math.min(sight.right, Math.round(this.extent[0] / pitch[0])); ++i) {
      const x = Math.round(this.toCanvas(i * pitch[0], 0)[0]) + 0.5;
      context.moveTo(x, 0);
      context.lineTo(x, canvas.height);
    }
    for (let i = Math.max(0, sight.top); i <= Math.min(sight.bottom, Math.round(this.extent[1] / pitch[1])); ++i) {
      const y = Math.round(this.toCanvas(0, i * pitch[1])[1]) + 0.5;
      context.moveTo(0, y);
      context.lineTo(canvas.width, y);
    }
    context.strokeStyle = styleColour("--grid");
    context.lineWidth = 1;
    context.stroke();
  }
  // The lines of the cursor and of the slice. They leave a gap at the voxel itself.
  drawCursor(u, v) {
    const { context, canvas } = this;
    const [x, y] = this.toCanvas(u, v).map((pixel) => Math.round(pixel) + 0.5);
    const gap_x = Math.max(6, this.pitch[0] * this.scale * 0.75), gap_y = Math.max(6, this.pitch[1] * this.scale * 0.75);
    context.beginPath();
    for (const [from, to] of [[0, x - gap_x], [x + gap_x, canvas.width]]) {
      context.moveTo(from, y);
      context.lineTo(to, y);
    }
    for (const [from, to] of [[0, y - gap_y], [y + gap_y, canvas.height]]) {
      context.moveTo(x, from);
      context.lineTo(x, to);
    }
    context.strokeStyle = styleColour("--cross");
    context.lineWidth = 1;
    context.stroke();
  }
}

class SliceView extends FlatView {
  constructor() {
    super("xy");
    this.run = 0;
    when(["slice", "look"], () => this.changed());
    when(["view", "cursor", "theme"], () => this.moved());
  }
  // Makes the picture again: of the slice that is asked for last.
  async changed() {
    const run = ++this.run;
    const number = state.slice;
    this.asked = performance.now();
    this.waits = true;
    const slices = await shownSlices(number);
    if (run !== this.run) return;
    this.waits = false;
    this.slices = slices;
    this.picture = pictureOf(slices, this.sight());
    this.draw();
    this.canvas.dataset.slice = number;
    this.canvas.dataset.mode = state.mode;
    showCounts(number, countsOf(slices));
    showReadout();
  }
  // Whether somebody is looking through the slices.
  isBusy() {
    return this.waits || performance.now() - this.asked < 300;
  }
  moved() {
    if (this.picture && !this.picture.whole) this.picture = pictureOf(this.slices, this.sight());
    this.draw();
  }
  draw() {
    this.clear();
    const { picture } = this;
    if (picture && picture.canvas) this.drawPicture(picture.canvas, picture.left, picture.top, picture.step, picture.step);
    this.drawGrid();
    this.drawCursor((state.cursor[0] + 0.5) * dx, (state.cursor[1] + 0.5) * dy);
    this.drawScale();
  }
  drawScale() {
    const most_mm = this.canvas.clientWidth / 6 / (this.scale * this.canvas.clientWidth / this.canvas.width);
    const power = 10 ** Math.floor(Math.log10(most_mm));
    const length = [5, 2, 1].find((digit) => digit * power <= most_mm) * power;
    const scale = $("scale");
    scale.firstElementChild.style.width = `${length * this.scale * this.canvas.clientWidth / this.canvas.width}px`;
    scale.firstElementChild.textContent = length < 1 ? `${+(length * 1000).toPrecision(1)} µm` : `${length} mm`;
  }
  pick([u, v]) {
    setCursor(u / dx, v / dy);
  }
}

class SectionView extends FlatView {
  constructor(name, axis) {
    super(name);
    this.axis = axis;
    when(["cursor", "look"], () => this.changed());
    when(["slice", "view", "theme"], () => this.draw());
    volumeReady.then(() => this.changed());
  }
  range() {
    const sight = this.sight();
    const count = Math.round(this.extent[1] / thickness);
    return [clamp(count - sight.bottom, 0, sliceCount), clamp(count - sight.top, 0, sliceCount)];
  }
  changed() {
    sections.reset(state.mode === "other" ? 1 : 0);
    this.picture = null;
    this.draw();
    readSections();
  }
  draw() {
    sections.reset(state.mode === "other" ? 1 : 0);
    const [begin, end] = this.range();
    // Four pixels of the picture for one of the canvas, where voxels are that small.
    const [across, along] = this.pitch.map((pitch) => Math.max(1, Math.floor(0.25 / (pitch * this.scale))));
    const { picture } = this;
    const covered = picture && picture.begin <= begin && picture.end >= end;
    if (!covered || picture.reading !== sections.readings || picture.across !== across || picture.along !== along) {
      const made = end > begin ? sectionPicture(this.axis, begin, end, across, along) : null;
      this.picture = { begin, end, across, along, reading: sections.readings, made };
      if (!covered) readSections();
    }
    this.clear();
    const count = Math.round(this.extent[1] / thickness);
    if (this.picture.made) this.drawPicture(this.picture.made, 0, count - this.picture.end, across, along);
    this.drawGrid();
    const place = this.axis === "front" ? (state.cursor[0] + 0.5) * dx : (height - state.cursor[1] - 0.5) * dy;
    this.drawCursor(place, this.extent[1] - (state.slice + 0.5) * thickness);
  }
  pick([u, v]) {
    if (this.axis === "front") setCursor(u / dx, state.cursor[1]);
    else setCursor(state.cursor[0], height - u / dy);
    setSlice((this.extent[1] - v) / thickness - 0.5);
  }
}

// Reads the lines of the sections that are in sight, once the cursor rests.
let sections_timer = 0;
function readSections() {
  clearTimeout(sections_timer);
  sections_timer = setTimeout(() => {
    const ranges = [front.range(), side.range()].filter(([begin, end]) => end > begin);
    if (ranges.length === 0) return;
    sections.read(Math.min(...ranges.map((range) => range[0])), Math.max(...ranges.map((range) => range[1])), () => {
      ++sections.readings;
      front.draw();
      side.draw();
    });
  }, 150);
}

let sliceView, front, side;
