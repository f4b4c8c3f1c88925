#!/usr/bin/python3
"""Writes the figures of several runs side by side on one HTML page that needs no other file.

    samples/report.py PAGE.html FILE_OR_FOLDER ...

The arguments are reports of `measure --report` (shown as a table, cumulative errors and the roughness of facets), figures of
`ssim --json` (shown as a table), pictures (.png, as `render` makes them), or folders that contain such files. The name of a run
is the name of its file, preceded by the name of the folder if there are several folders.
"""

import base64
import html
import io
import json
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

ERRORS = {"bias_mm": "bias", "mean_mm": "mean", "rms_mm": "RMS", "p50_mm": "50 %", "p95_mm": "95 %", "p99_mm": "99 %",
          "max_mm": "maximum"}
LIKENESS = {"ssim": "SSIM", "ssim_seen": "SSIM of what the eye sees", "flip": "FLIP"}
STYLE = """body{font:15px/1.4 sans-serif;margin:2em auto;max-width:76em;padding:0 1em;color:#222}
table{border-collapse:collapse}td,th{padding:.2em .8em;border-bottom:1px solid #ccc;text-align:right}
td:first-child,th:first-child{text-align:left}td.best{font-weight:bold}
.pictures{display:flex;flex-wrap:wrap;gap:1em}figure{margin:0}figure img{background:#808080;max-width:36em}
figcaption{font-size:85%}"""


def files_of(arguments):
    """Returns the files to show, each with its name."""
    found = []
    for argument in map(pathlib.Path, arguments):
        if argument.is_dir():
            found += sorted(path for path in argument.iterdir() if path.suffix in (".json", ".png"))
        elif argument.is_file():
            found.append(argument)
        else:
            raise SystemExit(f"report: no such file or folder '{argument}'")
    folders = {path.resolve().parent for path in found}
    return [(path, path.stem if len(folders) == 1 else f"{path.resolve().parent.name}/{path.stem}") for path in found]


def sorted_by_kind(files):
    """Returns three dictionaries by name: reports of measure, figures of ssim, pictures."""
    measured, alike, pictures = {}, {}, {}
    for path, name in files:
        if path.suffix == ".png":
            pictures[name] = path.read_bytes()
            continue
        try:
            content = json.loads(path.read_text())
        except ValueError as problem:
            raise SystemExit(f"report: '{path}' is not valid JSON: {problem}")
        if isinstance(content, dict) and "cumulative_mm" in content.get("area", {}):
            measured[name] = content
        elif isinstance(content, dict) and all(key in content for key in LIKENESS):
            alike[name] = content
        else:
            print(f"report: '{path}' is skipped: not from measure --report or ssim --json", file=sys.stderr)
    if not (measured or alike or pictures):
        raise SystemExit("report: nothing to show; give reports of measure, figures of ssim or pictures")
    return measured, alike, pictures


def table(heads, rows, best=None):
    """Returns an HTML table. `rows` maps names to numbers. `best` has a key function per column; the smallest key is marked."""
    lines = ["<table><tr><th>run</th>" + "".join(f"<th>{html.escape(head)}</th>" for head in heads) + "</tr>"]
    for name, row in rows.items():
        cells = ""
        for column, value in enumerate(row):
            key = best[column] if best else None
            mark = key and len(rows) > 1 and key(value) == min(key(other[column]) for other in rows.values())
            cells += f'<td{" class=best" if mark else ""}>{value:.4g}</td>'
        lines.append(f"<tr><td>{html.escape(name)}</td>{cells}</tr>")
    return "\n".join([*lines, "</table>"])


def picture(name, png):
    data = base64.b64encode(png).decode()
    return f'<figure><img alt="{html.escape(name)}" src="data:image/png;base64,{data}"><figcaption>{html.escape(name)}</figcaption></figure>'


def plot(name, width, draw):
    figure, axis = plt.subplots(figsize=(width, 3.6))
    draw(axis)
    axis.grid(alpha=0.3)
    stream = io.BytesIO()
    figure.savefig(stream, dpi=110, bbox_inches="tight")
    plt.close(figure)
    return picture(name, stream.getvalue())


def of_measure(measured):
    rows = {name: [report["area"][key] * 1000 for key in ERRORS] + [report["volume_error_percent"]]
            for name, report in measured.items()}

    def cumulative(axis):
        for name, report in measured.items():
            axis.plot([1000 * error for error in report["area"]["cumulative_mm"]], range(101), label=name)
        axis.set(xlabel="error not exceeded, µm", ylabel="% of the area", ylim=(0, 100), xlim=(0, None))
        axis.legend(fontsize=8)

    def roughness(axis):
        for n, (name, report) in enumerate(measured.items()):
            facets = report["facets"]
            places = [place + 0.8 * n / len(measured) for place in range(len(facets))]
            axis.bar(places, [1000 * facet["sq_mm"] for facet in facets], 0.8 / len(measured), alpha=0.4, color=f"C{n}")
            axis.bar(places, [1000 * facet["sq_band_mm"] for facet in facets], 0.8 / len(measured), color=f"C{n}", label=name)
        axis.set(xlabel="facet", ylabel="Sq, µm; dark: wavelengths beyond the cut-off")
        axis.legend(fontsize=8)

    parts = ["<h2>Distance to the reference mesh</h2><p>By area, in µm; volume error in %.</p>",
             table([*ERRORS.values(), "volume"], rows, [abs] * (len(ERRORS) + 1)), '<div class="pictures">',
             plot("cumulative error", 6, cumulative)]
    if any(report["facets"] for report in measured.values()):
        parts.append(plot("roughness", 6, roughness))
    return [*parts, "</div>"]


def main():
    if len(sys.argv) < 3 or not sys.argv[1].endswith(".html"):
        raise SystemExit("usage: samples/report.py PAGE.html FILE_OR_FOLDER ...")
    measured, alike, pictures = sorted_by_kind(files_of(sys.argv[2:]))
    parts = [f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>Comparison of prints</title><style>{STYLE}'
             "</style></head><body><h1>Comparison of prints</h1>"]
    if measured:
        parts += of_measure(measured)
    if alike:
        parts += ["<h2>Similarity of pictures</h2>",
                  table(LIKENESS.values(), {name: [figures[key] for key in LIKENESS] for name, figures in alike.items()},
                        [lambda value: -value, lambda value: -value, abs])]
    if pictures:
        parts += ['<h2>Pictures</h2><div class="pictures">', *(picture(name, png) for name, png in pictures.items()), "</div>"]
    pathlib.Path(sys.argv[1]).write_text("\n".join([*parts, "</body></html>\n"]))


main()
