
// Materials, figures, history and everything else in words. Names come from files: they are set as text, never as HTML.

function element(tag, text, name) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (name) made.className = name;
  return made;
}

const grouped = (count) => count.toLocaleString("en").replaceAll(",", "\u202f");
const millilitres = (count) => {
  const ml = count * dx * dy * dz / 1000;
  return ml === 0 ? "0" : ml < 0.001 ? ml.toExponential(1) : ml < 1 ? ml.toPrecision(3) : ml.toPrecision(4);
};
const mm = (length) => length.toFixed(3);

function swatch(colour) {
  const made = element("span", undefined, "swatch");
  made.style.backgroundColor = `rgb(${colour.join(",")})`;
  return made;
}

function materialRow(index) {
  const material = page.materials[index];
  const row = element("tr");
  const label = element("label"), box = element("input");
  box.type = "checkbox";
  box.checked = true;
  box.addEventListener("change", () => setMaterial(index, box.checked));
  label.append(box, swatch(material.rgba.slice(0, 3)), element("span", material.name));
  row.append(element("td"), element("td", "0"), element("td"), element("td"));
  row.firstElementChild.append(label);
  return row;
}

function fillMaterials() {
  const body = $("materials").tBodies[0];
  page.materials.forEach((_, index) => body.append(materialRow(index)));
  const sum = element("tr", undefined, "sum");
  sum.append(element("td", "all"), element("td", "0"), element("td"), element("td"));
  body.append(sum);
  showWholeCounts();
}

function showWholeCounts() {
  const voxels = page.stacks[state.mode === "other" ? 1 : 0].voxels;
  const all = voxels.reduce((sum, count) => sum + count, 0);
  const rows = $("materials").tBodies[0].rows;
  [...voxels, all].forEach((count, index) => {
    rows[index].cells[2].textContent = grouped(count);
    rows[index].cells[3].textContent = millilitres(count);
    rows[index].classList.toggle("off", index < values && !state.shown[index]);
  });
}

function showCounts(number, { counts, difference }) {
  const rows = $("materials").tBodies[0].rows;
  const all = counts.reduce((sum, count) => sum + count, 0);
  [...counts, all].forEach((count, index) => { rows[index].cells[1].textContent = grouped(count); });
  const table = $("difference");
  table.hidden = !difference;
  if (!difference) return;
  table.caption.textContent = state.mode === "below" ? "Against the slice below, voxels"
      : `Against ${page.stacks[1].name}, voxels of the slice`;
  table.tBodies[0].replaceChildren(...[["added", "only here"], ["removed", "only there"], ["changed", "another material"]].map(([kind, words]) => {
    const row = element("tr"), label = element("label");
    label.append(swatch(DIFFERENCE[kind]), element("span", words));
    row.append(element("td"), element("td", grouped(difference[kind])));
    row.firstElementChild.append(label);
    return row;
  }));
}

function showSlice() {
  $("slice").value = state.slice;
  $("number").value = layerOf(state.slice) - page.first[2];
  const bottom_mm = page.origin_mm[2] + layerOf(state.slice) * dz;
  $("height").textContent = `z ${mm(bottom_mm)} mm`;
  $("slice").setAttribute("aria-valuetext", `slice ${$("number").value} of ${layers - 1}`);
}

// What lies under the pointer, or else at the cursor.
let pointed = null;
function showReadout() {
  const [x, y] = pointed || state.cursor;
  const slices = sliceView.slices;
  const inside = x >= 0 && y >= 0 && x < width && y < height;
  if (!slices || !inside) {
    $("readout").textContent = "";
    return;
  }
  const value = slices[0].crop.value(slices[0].plane, x, y);
  const index = [columnIndex(x), rowIndex(y), layerOf(state.slice)];
  const place = index.map((i, axis) => mm(page.origin_mm[axis] + i * page.pitch_mm[axis]));
  $("readout").textContent = `${index.join("  ")}   ${place.join("  ")} mm   ${value ? page.materials[value - 1].name : "empty"}`;
}

function fillList(list, entries) {
  for (const [name, text] of entries) list.append(element("dt", name), element("dd", text));
}

function fillPage() {
  const [shown, other] = page.stacks;
  document.title = `${shown.name} – slices`;
  $("name").textContent = shown.name;
  const printer = page.printer && typeof page.printer === "object" ? page.printer : {};
  const title = [printer.title, printer.name].find((text) => typeof text === "string" && text) || "";
  $("subtitle").textContent = [title, size_mm.map((length) => length.toFixed(1)).join(" × ") + " mm"].filter(Boolean).join("  ·  ");
  fillList($("part"), [
    ["printer", title || "not stated"],
    ["voxel, mm", page.pitch_mm.map((length) => +length.toPrecision(6)).join(" × ")],
    ["voxels", page.size.map(grouped).join(" × ")],
    ["size, mm", size_mm.map((length) => length.toFixed(2)).join(" × ")],
    ["grid", shown.grid],
    ["made by", page.creator],
  ]);
  for (const line of shown.history) $("history").append(element("li", line));
  if (shown.history.length === 0) $("history").append(element("li", "none"));
  if (other) {
    $("other-section").hidden = false;
    $("other-name").textContent = other.name;
    for (const line of other.history) $("other-history").append(element("li", line));
  }
  const modes = [["materials", "Materials"], ["below", "Difference to the slice below"]];
  if (other) modes.push(["against", `Difference to ${other.name}`], ["other", other.name]);
  for (const [value, words] of modes) {
    const option = element("option", words);
    option.value = value;
    $("mode").append(option);
  }
  $("warning").textContent = page.warning && page.warning[0].toUpperCase() + page.warning.slice(1) + ".";
  $("warning").hidden = !page.warning;
  $("slice").max = sliceCount - 1;
  $("number").max = layers - 1;
  $("of").textContent = `of ${layers - 1}`;
}

const KEYS = [
  ["wheel  ↑ ↓", "one slice up or down; with Shift ten"],
  ["PgUp PgDn", "16 slices up or down"],
  ["Home End", "lowest, highest slice"],
  ["Ctrl wheel  + −", "larger, smaller; also two fingers"],
  ["drag  ← →", "move; with Shift more. On the part: turn it, as ↑ ↓ do"],
  ["click", "place the cursor; the sections go through it"],
  ["double click", "four times as large there"],
  ["0", "all of the part"],
  ["Z", "single voxels at the cursor"],
  ["1 … 9", "a material on or off"],
  ["D", "difference: off, to the slice below, to the other stack"],
  ["V", "enlarge the next view"],
  ["X", "cut the part at the slice"],
  ["T", "theme: system, light, dark"],
  ["?", "this list"],
];
function fillKeys() {
  const list = $("keys").querySelector("dl");
  fillList(list, KEYS);
}
