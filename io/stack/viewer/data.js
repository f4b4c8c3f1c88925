// What the page holds, and how slices are unpacked. docs/viewer.md has the format.

const page = JSON.parse(document.getElementById("stack").textContent);
const [width, height, layers] = page.size;
const [dx, dy, dz] = page.pitch_mm;
const values = page.materials.length;
const sliceCount = page.groups.reduce((sum, group) => sum + group[0], 0);
const SLICES_OF_GROUP = 16;

function bytesOf(id) {
  const text = atob(document.getElementById(id).textContent);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Lets the browser draw and listen.
const pause = () => new Promise((go) => setTimeout(go));

// Pixels of a slice within the crop of its group. Column x of row y lies at (y + 1) * stride + 8 + x; what surrounds them is 0.
class Crop {
  constructor([left, top, cropWidth, cropHeight]) {
    Object.assign(this, { left, top, width: cropWidth, height: cropHeight });
    this.stride = 16 + (cropWidth + 7 & ~7);
    this.size = this.stride * (cropHeight + 2);
  }
  at(x, y) {
    return (y - this.top + 1) * this.stride + 8 + x - this.left;
  }
  value(plane, x, y) {
    const inside = x >= this.left && y >= this.top && x < this.left + this.width && y < this.top + this.height;
    return inside ? plane[this.at(x, y)] : 0;
  }
}

// The streams of a group: gaps between misses of three classes, bits, values.
class Misses {
  constructor(bytes) {
    this.bytes = bytes;
    const view = new DataView(bytes.buffer);
    let at = 1024 + 20;
    this.next = [];
    this.end = [];
    for (let i = 0; i < 5; ++i) {
      this.next.push(at);
      at += view.getUint32(1024 + 4 * i, true);
      this.end.push(at);
    }
    this.hits = [0, 0, 0, 0];
    this.bit = 0;
    for (let i = 0; i < 3; ++i) this.readGap(i);
  }
  readGap(i) {
    if (this.next[i] >= this.end[i]) {
      this.hits[i] = Infinity;
      return;
    }
    let gap = 0, factor = 1, byte;
    do {
      byte = this.bytes[this.next[i]++];
      gap += (byte & 127) * factor;
      factor *= 128;
    } while (byte > 127);
    this.hits[i] = gap;
  }
  isMiss(group) {
    if (group === 4) {
      const miss = this.bytes[this.next[3]] >> this.bit & 1;
      this.bit = this.bit + 1 & 7;
      if (this.bit === 0) ++this.next[3];
      return miss === 1;
    }
    if (this.hits[group - 1]-- > 0) return false;
    this.readGap(group - 1);
    return true;
  }
}

function unpackPlane(crop, rules, misses, plane, base) {
  const stride = crop.stride;
  const here = plane, words = new Uint32Array(plane.buffer), baseWords = new Uint32Array(base.buffer);
  const rowWords = stride >> 2;
  for (let y = 0; y < crop.height; ++y) {
    const begin = (y + 1) * stride + 8, end = begin + crop.width;
    for (let i = begin; i < end;) {
      const b = base[i];
      if ((i & 7) === 0 && i + 8 <= end) {
        const w = i >> 2, same = b * 0x01010101 | 0;
        const group = rules[b ? 512 : 0] >> 2;
        if ((words[w - 1] | 0) === same && (baseWords[w] | 0) === same && (baseWords[w + 1] | 0) === same &&
            (words[w - rowWords] | 0) === same && (words[w - rowWords + 1] | 0) === same &&
            (baseWords[w - 1] | 0) === same && (baseWords[w + 2] | 0) === same &&
            (words[w - rowWords - 1] | 0) === same && (words[w - rowWords + 2] | 0) === same &&
            (baseWords[w - rowWords] | 0) === same && (baseWords[w - rowWords + 1] | 0) === same &&
            (baseWords[w + rowWords] | 0) === same && (baseWords[w + rowWords + 1] | 0) === same &&
            group < 4 && (group === 0 || misses.hits[group - 1] >= 8)) {
          if (group) misses.hits[group - 1] -= 8;
          words[w] = same;
          words[w + 1] = same;
          i += 8;
          continue;
        }
      }
      const left = here[i - 1], above = here[i - stride], right = base[i + 1];
      const rule = rules[
          (left !== b) | (above !== b) << 1 | (right !== b) << 2 | (base[i + stride] !== b) << 3 |
          (here[i - stride + 1] !== b) << 4 | (here[i - stride - 1] !== b) << 5 | (base[i - 1] !== b) << 6 |
          (base[i - stride] !== b) << 7 | (here[i - 2] !== b) << 8 | (b !== 0) << 9];
      const candidate = rule & 3;
      let value = candidate === 0 ? b : candidate === 1 ? left : candidate === 2 ? above : right;
      if (rule > 3 && misses.isMiss(rule >> 2)) {
        const other = values > 1 ? misses.bytes[misses.next[4]++] : 0;
        value = other < value ? other : other + 1;
      }
      here[i++] = value;
    }
  }
}

// The part of `plane`, which lies in `from`, that lies in `to`.
function cropped(plane, from, to) {
  const result = new Uint8Array(to.size);
  const left = Math.max(from.left, to.left), right = Math.min(from.left + from.width, to.left + to.width);
  const bottom = Math.min(from.top + from.height, to.top + to.height);
  for (let y = Math.max(from.top, to.top); y < bottom && left < right; ++y) {
    const at = from.at(left, y);
    result.set(plane.subarray(at, at + right - left), to.at(left, y));
  }
  return result;
}

// `rest` is awaited now and then. Throws what it throws.
async function unpackGroup(stack, index, first, rest = pause) {
  const crop = new Crop(page.groups[index][1 + stack]);
  const group = { crop, planes: [], bytes: 0 };
  if (crop.width === 0) {
    const empty = new Uint8Array(crop.size);
    for (let i = 0; i < page.groups[index][0]; ++i) group.planes.push(empty);
    return group;
  }
  const bytes = await inflated(bytesOf(`group-${stack}-${index}`));
  const rules = bytes.subarray(0, 1024), misses = new Misses(bytes);
  let before = new Uint8Array(crop.size);
  let since = performance.now();
  for (let i = 0; i < page.groups[index][0]; ++i) {
    const plane = new Uint8Array(crop.size);
    unpackPlane(crop, rules, misses, plane, first ? cropped(first.planes[i], first.crop, crop) : before);
    group.planes.push(plane);
    group.bytes += crop.size;
    before = plane;
    if (performance.now() - since > 12) {
      await rest();
      since = performance.now();
    }
  }
  return group;
}

// Groups that were used last stay unpacked.
const MOST_CACHED_BYTES = 256 << 20;
const cache = new Map();

function groupOf(stack, index) {
  const key = `${stack}-${index}`;
  let entry = cache.get(key);
  if (entry) {
    cache.delete(key);
  } else {
    entry = { group: null, promise: null };
    entry.promise = (stack === 0 ? unpackGroup(0, index) : groupOf(0, index).then((first) => unpackGroup(stack, index, first)))
        .then((group) => {
          entry.group = group;
          shrinkCache(key);
          return group;
        });
  }
  cache.set(key, entry);
  return entry.promise;
}

function shrinkCache(kept) {
  let bytes = 0;
  for (const entry of cache.values()) bytes += entry.group ? entry.group.bytes : 0;
  for (const [key, entry] of cache) {
    if (bytes <= MOST_CACHED_BYTES) break;
    if (key === kept || !entry.group) continue;
    bytes -= entry.group.bytes;
    cache.delete(key);
  }
}

// A slice: { crop, plane }. Slices are counted from 0 at the bottom, without those that the page leaves out.
async function sliceOf(stack, number) {
  if (number < 0) return { crop: new Crop([0, 0, 0, 0]), plane: new Uint8Array(0) };
  const group = await groupOf(stack, Math.floor(number / SLICES_OF_GROUP));
  return { crop: group.crop, plane: group.planes[number % SLICES_OF_GROUP] };
}
