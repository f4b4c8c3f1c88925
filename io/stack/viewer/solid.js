
// The part in three dimensions: rays through the volume of cubes, in WebGL 2.

const VERTEX_SHADER = `#version 300 es
in vec2 corner;
out vec2 place;
void main() { place = corner; gl_Position = vec4(corner, 0.0, 1.0); }`;

const FRAGMENT_SHADER = `#version 300 es
precision highp float;
precision highp sampler3D;
in vec2 place;
out vec4 colour;
uniform sampler3D share;
uniform sampler3D value;
uniform sampler2D colours;
uniform sampler3D mean;  // of all materials
uniform vec3 blocks;
uniform bool whole;      // no material is hidden
uniform mat3 turn;      // from the eye to the part
uniform vec2 frame;     // half the width and height of the view, cells
uniform vec3 cells;     // size of the volume
uniform vec3 middle;    // where the view looks, cells
uniform float cut;      // nothing above this is shown, cells
uniform vec3 stage;
const float LEVEL = 0.42;

vec4 materialAt(vec3 at) {
  float index = floor(texture(value, at / cells).r * 255.0 + 0.5);
  return texelFetch(colours, ivec2(int(index), 0), 0);
}
// The mean colour of what is around, inside of the surface.
vec3 colourAt(vec3 at, vec3 normal, vec4 material) {
  vec4 seen = texture(mean, (at - 1.0 - normal) * 0.5 / blocks);
  return whole && seen.a > 0.0 ? seen.rgb / seen.a : material.rgb;
}
float density(vec3 at) {
  return texture(share, at / cells).r;
}
void main() {
  vec3 along = turn * vec3(0.0, 0.0, -1.0);
  vec3 eye = middle + turn * vec3(place * frame, 0.0) - along * length(cells) * 2.0;
  vec3 most = vec3(cells.xy, min(cells.z, cut));
  vec3 safe = mix(along, vec3(1e-6), lessThan(abs(along), vec3(1e-6)));
  vec3 a = (vec3(0.0) - eye) / safe, b = (most - eye) / safe;
  vec3 near = min(a, b), far = max(a, b);
  float from = max(max(near.x, near.y), near.z), to = min(min(far.x, far.y), far.z);
  vec3 backdrop = stage * (1.02 - 0.10 * length(place));
  colour = vec4(backdrop, 1.0);
  if (from >= to) return;
  float step_length = 0.6, t = from + 0.01, before = t;
  bool hit = false;
  vec4 material = vec4(0.0);
  for (int i = 0; i < 1200 && t < to; ++i, before = t, t += step_length) {
    vec3 at = eye + along * t;
    if (density(at) < LEVEL) continue;
    material = materialAt(at);
    if (material.a == 0.0) material = materialAt(at + along * 0.5);
    if (material.a > 0.0) { hit = true; break; }
  }
  if (!hit) return;
  bool cap = before <= from + 0.011 && near.z == from && cut < cells.z && along.z < 0.0;
  for (int i = 0; i < 6 && !cap; ++i) {
    float half_way = 0.5 * (before + t);
    if (density(eye + along * half_way) < LEVEL) before = half_way; else t = half_way;
  }
  vec3 at = eye + along * t;
  vec3 normal;
  if (cap) {
    normal = vec3(0.0, 0.0, 1.0);
    material = materialAt(at - vec3(0.0, 0.0, 0.5));
  } else {
    vec3 slope = vec3(0.0);
    for (float reach = 1.0; reach < 3.6; reach += 1.0) {
      slope += vec3(density(at + vec3(reach, 0, 0)) - density(at - vec3(reach, 0, 0)),
                    density(at + vec3(0, reach, 0)) - density(at - vec3(0, reach, 0)),
                    density(at + vec3(0, 0, reach)) - density(at - vec3(0, 0, reach))) / reach;
    }
    normal = length(slope) > 1e-4 ? -normalize(slope) : -along;
  }
  vec3 base = colourAt(at, normal, material);
  vec3 key = normalize(turn * vec3(-0.45, 0.75, 0.85)), fill = normalize(turn * vec3(0.9, 0.1, 0.4));
  float open = 1.0;
  for (float reach = 2.0; reach < 9.0; reach += 2.0) open -= 0.11 * density(at + normal * reach);
  float light = 0.30 + 0.62 * max(dot(normal, key), 0.0) + 0.16 * max(dot(normal, fill), 0.0);
  vec3 halfway = normalize(key - along);
  vec3 lit = (0.03 + 0.97 * base) * light * open + 0.07 * pow(max(dot(normal, halfway), 0.0), 24.0);
  if (cap) lit = base * 0.97;
  colour = vec4(lit, 1.0);
}`;

// The mean of each cell and its neighbours with weights 1, 2, 1 along each axis. Walls as thin as a cell stay. Cells at
// the rim are empty.
function smoothed(bytes, [nx, ny, nz]) {
  let from = bytes;
  for (const stride of [1, nx, nx * ny]) {
    const to = new Uint8Array(bytes.length);
    for (let i = stride; i < bytes.length - stride; ++i) to[i] = from[i - stride] + 2 * from[i] + from[i + stride] + 2 >> 2;
    from = to;
  }
  for (let i = 0; i < bytes.length; ++i) from[i] = Math.max(from[i], bytes[i] * 0.9);
  return from;
}

class SolidView {
  constructor() {
    this.figure = $("view-solid");
    this.canvas = this.figure.querySelector("canvas");
    this.turn_z = -0.6;
    this.tilt = 0.45;
    this.zoom = 1;
    const gl = this.canvas.getContext("webgl2", { antialias: false, preserveDrawingBuffer: true });
    if (!gl) {
      this.figure.querySelector(".sorry").hidden = false;
      this.figure.querySelector(".cut").hidden = true;
      this.canvas.hidden = true;
      return;
    }
    this.gl = gl;
    this.program = this.linked();
    new ResizeObserver(() => this.resize()).observe(this.canvas);
    volumeReady.then(() => {
      this.upload();
      this.draw();
    });
    when(["look"], () => { this.uploadColours(); this.draw(); });
    when(["theme", "view"], () => this.draw());
    when(["slice"], () => { if (state.cut) this.draw(); });
  }
  linked() {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, FRAGMENT_SHADER]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS))
      console.error(gl.getProgramInfoLog(program), ...gl.getAttachedShaders(program).map((shader) => gl.getShaderInfoLog(shader)));
    gl.useProgram(program);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 3, -1, -1, 3]), gl.STATIC_DRAW);
    const corner = gl.getAttribLocation(program, "corner");
    gl.enableVertexAttribArray(corner);
    gl.vertexAttribPointer(corner, 2, gl.FLOAT, false, 0, 0);
    return program;
  }
  uniform(name) {
    return this.gl.getUniformLocation(this.program, name);
  }
  upload() {
    const { gl } = this;
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    // A rim of empty cells closes the part at the ends of the volume.
    const [nx, ny, nz] = cells;
    this.cells = [nx + 2, ny + 2, nz + 2];
    const padded = (bytes) => {
      const result = new Uint8Array((nx + 2) * (ny + 2) * (nz + 2));
      for (let z = 0; z < nz; ++z) {
        for (let y = 0; y < ny; ++y) {
          // Rows of slices run from the greatest y downwards.
          const from = (z * ny + ny - 1 - y) * nx;
          result.set(bytes.subarray(from, from + nx), ((z + 1) * (ny + 2) + y + 1) * (nx + 2) + 1);
        }
      }
      return result;
    };
    // Few voxels make a cube: without this, the rows of cubes that have one more show as terraces.
    const share = smoothed(padded(volume.share), this.cells);
    for (const [unit, name, bytes, filter] of [[0, "share", share, gl.LINEAR], [1, "value", padded(volume.value), gl.NEAREST]]) {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_3D, gl.createTexture());
      for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R]) gl.texParameteri(gl.TEXTURE_3D, side, gl.CLAMP_TO_EDGE);
      gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MIN_FILTER, filter);
      gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MAG_FILTER, filter);
      gl.texImage3D(gl.TEXTURE_3D, 0, gl.R8, ...this.cells, 0, gl.RED, gl.UNSIGNED_BYTE, bytes);
      gl.uniform1i(this.uniform(name), unit);
    }
    gl.activeTexture(gl.TEXTURE2);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.uniform1i(this.uniform("colours"), 2);
    this.uploadMeans();
    gl.uniform3f(this.uniform("cells"), ...this.cells);
    this.uploadColours();
    this.ready = true;
  }
  // Alpha tells blocks with a colour from empty ones, which must not darken their neighbours.
  uploadMeans() {
    const { gl } = this;
    const [nx, ny, nz] = page.volume.blocks;
    // Rows run upwards here, and begin where the last cube ends, which may be half of a block.
    const rows = cells[1], bytes = new Uint8Array(4 * nx * ny * nz);
    const counted = new Uint8Array(nx * ny * nz), sums = new Uint16Array(3 * nx * ny * nz);
    for (let z = 0; z < nz; ++z) {
      for (let y = 0; y < rows; ++y) {
        for (let x = 0; x < nx; ++x) {
          const from = (z * ny + (rows - 1 - y >> 1)) * nx + x, to = (z * ny + (y >> 1)) * nx + x;
          if (!volume.colour[3 * from] && !volume.colour[3 * from + 1] && !volume.colour[3 * from + 2]) continue;
          ++counted[to];
          for (let i = 0; i < 3; ++i) sums[3 * to + i] += volume.colour[3 * from + i];
        }
      }
    }
    for (let i = 0; i < counted.length; ++i) {
      if (!counted[i]) continue;
      for (let k = 0; k < 3; ++k) bytes[4 * i + k] = sums[3 * i + k] / counted[i];
      bytes[4 * i + 3] = 255;
    }
    gl.activeTexture(gl.TEXTURE3);
    gl.bindTexture(gl.TEXTURE_3D, gl.createTexture());
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R]) gl.texParameteri(gl.TEXTURE_3D, side, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_3D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texImage3D(gl.TEXTURE_3D, 0, gl.RGBA8, nx, ny, nz, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    gl.uniform1i(this.uniform("mean"), 3);
    gl.uniform3f(this.uniform("blocks"), nx, ny, nz);
  }
  uploadColours() {
    const { gl } = this;
    const bytes = new Uint8Array(256 * 4);
    page.materials.forEach((material, index) => {
      if (state.shown[index]) bytes.set([...material.rgba.slice(0, 3), 255], 4 * (index + 1));
    });
    gl.activeTexture(gl.TEXTURE2);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  }
  resize() {
    // Rays are dear; a view of many pixels is drawn at half its resolution.
    const ratio = window.devicePixelRatio || 1;
    const pixels = this.canvas.clientWidth * this.canvas.clientHeight * ratio * ratio;
    const factor = ratio * Math.min(1, Math.sqrt(1.2e6 / Math.max(pixels, 1)));
    this.canvas.width = Math.max(1, Math.round(this.canvas.clientWidth * factor));
    this.canvas.height = Math.max(1, Math.round(this.canvas.clientHeight * factor));
    this.draw();
  }
  turned(dx_pixels, dy_pixels) {
    this.turn_z += dx_pixels * 0.008;
    this.tilt = clamp(this.tilt + dy_pixels * 0.008, -Math.PI / 2, Math.PI / 2);
    this.draw();
  }
  draw() {
    if (!this.ready || this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.drawNow();
    });
  }
  drawNow() {
    const { gl, canvas } = this;
    gl.viewport(0, 0, canvas.width, canvas.height);
    const [cz, sz, ct, st] = [Math.cos(this.turn_z), Math.sin(this.turn_z), Math.cos(this.tilt), Math.sin(this.tilt)];
    // Columns: what is right, up, and towards the eye.
    gl.uniformMatrix3fv(this.uniform("turn"), false, [cz, -sz, 0, sz * st, cz * st, ct, -sz * ct, -cz * ct, st]);
    const radius = Math.hypot(...this.cells) * 0.42 / this.zoom;
    const aspect = canvas.width / canvas.height;
    gl.uniform2f(this.uniform("frame"), radius * Math.max(1, aspect), radius * Math.max(1, 1 / aspect));
    gl.uniform3f(this.uniform("middle"), ...this.cells.map((count) => count / 2));
    gl.uniform1i(this.uniform("whole"), state.shown.every(Boolean) ? 1 : 0);
    gl.uniform1f(this.uniform("cut"), state.cut ? 1 + (state.slice + 1) * thickness / page.volume.cell_mm : 1e9);
    const context = document.createElement("canvas").getContext("2d");
    context.fillStyle = styleColour("--stage");
    const stage = [1, 3, 5].map((at) => parseInt(context.fillStyle.slice(at, at + 2), 16) / 255);
    gl.uniform3f(this.uniform("stage"), ...stage);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}
