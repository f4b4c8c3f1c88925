#!/usr/bin/python3
"""Changes single lines of the program at random, and reports which changes no test notices. For nightly runs.

    tests/mutate.py --count 40 --minutes 120 --seed 1

Works on a copy of the sources in build/mutants, with a release build of its own. Each mutant goes through these steps, until one
of them tells:

1. It is built. One that does not compile, or that too many sources include (--most-sources), is left out of the sample.
2. The suites that mirror its folder run (tests/kernels/dither for ops/kernels/dither), and the tests of the program that are named
   like its file. A failure, a crash or a test that hangs catches it.
3. The sample chains of tests/bench/digests.py run. A mutant that changes no byte of what they write is set apart as `no effect`: it is
   equivalent, or in code that the chains do not reach. These are listed, to be looked at, and are not part of the share.
4. With --tests all, all other tests run, except those that tests/support/coverage_unsuited.txt names. A mutant that no test has
   caught is a survivor: an output is wrong, and no test says so.

The share is caught / (caught + survived). Each result is also a line of JSON in build/mutants/results.jsonl.
"""

import argparse
import collections
import json
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
HOME = ROOT / "build/mutants"
TREE = HOME / "tree"
BUILD = TREE / "build/release"
LAYERS = {"kernels": "ops/kernels/", "io": "io/", "engine": "vdbdither/", "ops": "ops/"}

# What a change replaces by what. Words that .clang-format surrounds by blanks are operators, not parts of templates.
SWAPS = [(" < ", " <= "), (" <= ", " < "), (" > ", " >= "), (" >= ", " > "), (" == ", " != "), (" != ", " == "), (" && ", " || "),
         (" || ", " && "), (" + ", " - "), (" - ", " + "), (" * ", " / "), (" / ", " * "), (" % ", " * "), (" += ", " -= "),
         (" -= ", " += "), (" |= ", " &= "), (" &= ", " |= "), (" | ", " & "), ("++", "--"), ("--", "++"),
         ("std::min(", "std::max("), ("std::max(", "std::min("), ("std::floor(", "std::ceil("), ("std::ceil(", "std::floor("),
         ("true", "false"), ("false", "true"), ("continue;", "break;")]
NUMBER = re.compile(r"(?<![\w.\"'])(\d+(?:\.\d+)?)([fF]?[uU]?)(?![\w.\"'])")
CONDITION = re.compile(r"^(\s*(?:\} else )?if )\((.*)\)( \{| [^{]*;)$")
STATEMENT = re.compile(r"^\s+(?!return|using|throw|case|delete|else|goto)[\w.\[\]>*()-]+(?: [-+*/|&^]?= .*|\(.*\));$")


def mutants_of(line):
    """Returns what the line may be changed into, and how that is called."""
    found = []
    if '"' in line:
        return found
    for old, new in SWAPS:
        at = line.find(old)
        while at >= 0:
            words = (old[0].isalpha() and at > 0 and (line[at - 1].isalnum() or line[at - 1] in "_:"))
            if not words:
                found.append((line[:at] + new + line[at + len(old):], f"{old.strip()} to {new.strip()}"))
            at = line.find(old, at + 1)
    for match in NUMBER.finditer(line):
        number = match[1]
        other = f"{float(number) + 0.5}" if "." in number else str(int(number) + 1)
        found.append((line[:match.start()] + other + line[match.end(1):], f"{number} to {other}"))
    if match := CONDITION.match(line):
        found.append((f"{match[1]}(!({match[2]})){match[3]}", "condition negated"))
    if STATEMENT.match(line):
        found.append((re.match(r"\s*", line)[0] + ";", "statement deleted"))
    return found


def candidates(layers):
    """Returns path, number and mutants of every line that has any, in a fixed order."""
    found = []
    for path in sorted([*TREE.glob("vdbdither/**/*"), *TREE.glob("io/**/*"), *TREE.glob("ops/**/*")]):
        name = str(path.relative_to(TREE))
        if path.suffix not in (".cpp", ".h") or layer_of(name) not in layers:
            continue
        for number, line in enumerate(path.read_text().splitlines()):
            code = line.strip()
            if code.startswith(("//", "#", "template", "static_assert", "namespace", "using", "case", "friend")) or "//" in line:
                continue
            if mutants := mutants_of(line):
                found.append((name, number, mutants))
    return found


def layer_of(name):
    return next(layer for layer, head in LAYERS.items() if name.startswith(head))


def run(command, seconds, **keywords):
    """Returns the exit code of a command, or None if it took longer and was ended, with all that it started."""
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                               start_new_session=True, **keywords)
    try:
        return process.wait(seconds)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, 9)
        process.wait()
        return None


class Mutants:
    def __init__(self, given):
        self.given = given
        self.record = HOME / "digests.json"
        self.copy_sources()
        self.build_all()

    def copy_sources(self):
        """Brings the copy to the state of the sources. Files that stay the same keep their times."""
        names = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=ROOT, check=True,
                               capture_output=True).stdout.decode().split("\0")
        for name in filter(None, names):
            source, target = ROOT / name, TREE / name
            if source.is_file() and not (target.is_file() and target.read_bytes() == source.read_bytes()):
                target.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(source, target)
        for path in (path for folder in ("vdbdither", "io", "ops", "tests") for path in (TREE / folder).rglob("*")):
            if path.is_file() and str(path.relative_to(TREE)) not in names and path.suffix != ".pyc":
                path.unlink()

    def build_all(self):
        configure = ["cmake", "--preset", "release", "-DBUILD_TESTING=ON"]
        subprocess.run(configure, cwd=TREE, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        subprocess.run(["ninja", "-C", BUILD, f"-j{self.given.jobs}"], check=True, stdout=subprocess.DEVNULL)
        with open(self.record, "w") as record:
            subprocess.run([TREE / "tests/bench/digests.py", "record", "--only", self.given.chains, BUILD / "vdbdither"], check=True,
                           stdout=record, stderr=subprocess.DEVNULL)

    def targets(self, name):
        """Returns the target of the program, and that of the unit tests that mirror a source."""
        layer = layer_of(name)
        if name.startswith("vdbdither/program"):
            return ["vdbdither_program"]
        test = "model" if name.startswith("vdbdither/model") else layer
        return ["vdbdither_program", f"{test}_test"]

    def build(self, targets):
        return run(["ninja", "-C", BUILD, f"-j{self.given.jobs}", *targets], 3600) == 0

    def sources_of(self, targets):
        """Returns how many sources a build would compile."""
        done = subprocess.run(["ninja", "-C", BUILD, "-n", *targets], capture_output=True, text=True)
        return len(re.findall(r"Building CXX object", done.stdout))

    def near_tests(self, name):
        """Yields the commands of the tests that concern a source most, each with its seconds."""
        path = pathlib.Path(name)
        mirrored = TREE / "tests" / pathlib.Path(*path.parts[1:-1] if path.parts[0] in ("ops", "vdbdither") else path.parts[:-1])
        if layer_of(name) == "ops":
            files = [TREE / f"tests/ops/{path.stem}_test.cpp", TREE / "tests/ops/contract_test.cpp"]
        else:
            files = sorted(mirrored.glob("*_test.cpp")) if mirrored.is_dir() else []
        suites = {suite for file in files if file.is_file()
                  for suite in re.findall(r"^(?:TYPED_)?TEST(?:_F|_P)?\((\w+),", file.read_text(), re.MULTILINE)}
        for target in self.targets(name)[1:]:
            near = ":".join(f"{suite}.*:{suite}/*:*/{suite}.*" for suite in sorted(suites))
            if near:
                yield [BUILD / "tests" / target, f"--gtest_filter={near}", "--gtest_brief=1", "--gtest_fail_fast"], 240
        stems = {path.stem.replace("_", "-")} if layer_of(name) == "ops" else {path.stem, path.stem.removesuffix("_reader")}
        tests = [file.stem for file in sorted((TREE / "tests/cli").glob("*_test.py"))
                 if any(stem in file.stem for stem in stems) and "fuzz" not in file.stem]
        if tests:
            yield self.ctest("^cli\\.(" + "|".join(tests) + ")\\."), 600

    def ctest(self, names):
        unsuited = [line.split()[0] for line in (TREE / "tests/support/coverage_unsuited.txt").read_text().splitlines()
                    if line and not line.startswith("#")]
        return ["ctest", "--test-dir", BUILD, "-j", str(self.given.jobs), "--stop-on-failure", "-R", names, "-E",
                "^(" + "|".join(unsuited) + ")$"]

    def changes_an_output(self):
        return run([TREE / "tests/bench/digests.py", "compare", "--only", self.given.chains, BUILD / "vdbdither", self.record],
                   1800) != 0

    def verdict(self, name):
        targets = self.targets(name)
        if self.sources_of(targets) > self.given.most_sources:
            return "left out", "too many sources include it"
        if not self.build(targets):
            return "left out", "it does not compile"
        for command, seconds in self.near_tests(name):
            code = run(command, seconds, cwd=HOME)
            if code != 0:
                return "caught", "it hangs" if code is None else pathlib.Path(command[0]).name
        if not self.changes_an_output():
            return "no effect", ""
        if self.given.tests == "all" and (not self.build(["all"]) or run(self.ctest("."), 7200) != 0):
            return "caught", "all tests"
        return "survived", ""

    def judge(self, name, number, new):
        path = TREE / name
        text = path.read_text()
        lines = text.split("\n")
        lines[number] = new
        try:
            path.write_text("\n".join(lines))
            return self.verdict(name)
        finally:
            path.write_text(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100, help="mutants in the share (%(default)s)")
    parser.add_argument("--minutes", type=float, default=480, help="begin no mutant after this time (%(default)s)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--layers", default=",".join(LAYERS), help="which layers to change (%(default)s)")
    parser.add_argument("--tests", choices=("near", "all"), default="all", help="which tests run (%(default)s)")
    parser.add_argument("--chains", default="*", metavar="PATTERN", help="sample chains whose outputs are compared")
    parser.add_argument("--most-sources", type=int, default=30, help="leave out a change that compiles more (%(default)s)")
    given = parser.parse_args()
    sys.stdout.reconfigure(line_buffering=True)
    end = time.monotonic() + 60 * given.minutes
    mutants = Mutants(given)
    chance = random.Random(given.seed)
    sample = candidates(given.layers.split(","))
    chance.shuffle(sample)
    print(f"seed {given.seed}, {len(sample)} lines with {sum(len(of_line) for _, _, of_line in sample)} mutants, one of a line")
    counts, by_layer, listed = collections.Counter(), collections.defaultdict(collections.Counter), []
    with open(HOME / "results.jsonl", "a") as results:
        for name, number, of_line in sample:
            if time.monotonic() > end or counts["caught"] + counts["survived"] >= given.count:
                break
            new, kind = chance.choice(of_line)
            start = time.monotonic()
            verdict, reason = mutants.judge(name, number, new)
            counts[verdict] += 1
            by_layer[layer_of(name)][verdict] += 1
            place = f"{name}:{number + 1}: {kind}"
            print(f"{verdict:9} {reason:10} {time.monotonic() - start:5.0f} s  {place}")
            results.write(json.dumps({"place": place, "line": new.strip(), "verdict": verdict, "by": reason, "seed": given.seed}) + "\n")
            results.flush()
            if verdict in ("survived", "no effect"):
                listed.append((verdict, place, new.strip()))
    for verdict in ("survived", "no effect"):
        print(f"\n{verdict}:", *(f"  {place}\n      {line}" for kind, place, line in listed if kind == verdict), sep="\n")
    print()
    for layer, found in sorted(by_layer.items()):
        print(f"{layer}: " + ", ".join(f"{number} {verdict}" for verdict, number in sorted(found.items())))
    judged = counts["caught"] + counts["survived"]
    share = f"{100 * counts['caught'] / judged:.0f} %" if judged else "nothing"
    print(f"caught {counts['caught']} of {judged} mutants ({share}); {counts['no effect']} without effect, {counts['left out']} left out")
    return 1 if counts["survived"] else 0


if __name__ == "__main__":
    sys.exit(main())
