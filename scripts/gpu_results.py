#!/usr/bin/env python3
"""Turns what scripts/gpu.sh brought back into a folder of results, and writes the README's table of GPUs anew.

usage: scripts/gpu_results.py ARCHIVE [RESULTS [README]]
  ARCHIVE   results.tar.gz
  RESULTS   folder of results [default: benches/results]; gets DATE_ADAPTER/ with report.md, gpu.json and what was measured
  README    file whose table is written from the results of GPUs, without rehearsals [default: README.md]

What did not run is called missing. Needs nothing but Python 3.8.
"""

import json
import re
import statistics
import sys
import tarfile
import zlib
from pathlib import Path

MISSING = "missing"
BEGIN = "<!-- written by scripts/gpu_results.py -->"
END = "<!-- end of what scripts/gpu_results.py writes -->"
BUDGETS = ["1.5", "4", "12", "60"]
CHECKS = {"check": "own path", "check_exchange": "exchange", "check_fixed": "fixed"}
# Pictures and logs stay in the archive.
KEPT = re.compile(r"(\./)?[\w.]+\.(json|tsv|txt)")


def read(archive):
    """The files of an archive by name."""
    files = {}
    with tarfile.open(archive) as tar:
        for member in tar:
            if member.isfile() and KEPT.fullmatch(member.name):
                files[Path(member.name).name] = tar.extractfile(member).read().decode(errors="replace")
    return files


def parsed(files, name):
    """The result in a JSON file, or None where it is missing, was cut off, or tells an error."""
    try:
        result = json.loads(files[name + ".json"])
    except (KeyError, ValueError):
        return None
    return result if isinstance(result, dict) and "error" not in result else None


def collect(files):
    """All results as one object."""
    meta = dict(line.split(" ", 1) for line in files.get("meta.txt", "").splitlines() if " " in line)
    date = meta.get("date", "")
    planned = files.get("planned.txt", "").split()
    rows = [line.split("\t") for line in files.get("parts.tsv", "").splitlines()[1:]]
    ran = {row[0]: {"status": row[1], "seconds": row[3], "reason": row[4]} for row in rows if len(row) == 5}
    parts = {name: ran.get(name, {"status": MISSING}) for name in [*planned, *(name for name in ran if name not in planned)]}
    measured = {name: parsed(files, name) for name in parts if name not in ("scene", "kernels", "deterministic")}
    adapters = (measured.pop("adapters", None) or {}).get("adapters", [])
    used = next((result for name in ("ceilings", "step", "check") if (result := measured.get(name))), {})
    listed = [adapter for adapter in adapters if adapter["name"] == used.get("adapter")] or adapters
    return {
        "date": date if re.fullmatch(r"\d{4}-\d\d-\d\d", date) else "unknown-date",
        "commit": meta.get("commit", "unknown"),
        "datasets": meta.get("datasets", "").split(),
        "rehearsal": meta.get("rehearsal") == "1",
        "adapter": listed[0] if listed else None,
        "machine": files.get("machine.txt", MISSING).splitlines(),
        "parts": parts,
        "deterministic": files.get("deterministic.txt", MISSING).strip(),
        "kernel_tests": kernel_tests(files.get("kernels.txt", "")),
        "measured": measured,
    }


def kernel_tests(text):
    """The verdict of the kernel tests, and which failed."""
    verdict = re.search(r"^test result: .*?(\d+) passed; (\d+) failed", text, re.M)
    if not verdict:
        return {"verdict": MISSING, "failed": []}
    failed = re.findall(r"^test (\S+) \.\.\. FAILED", text, re.M)
    return {"verdict": f"{verdict[1]} passed, {verdict[2]} failed", "failed": failed}


def cell(value):
    """What a table can hold."""
    return re.sub(r"\s+", " ", str(value)).replace("|", "\\|")


def table(head, rows, left=1):
    """Markdown; the first columns are text, the others numbers."""
    align = ["---"] * left + ["---:"] * (len(head) - left)
    return "\n".join("| " + " | ".join(map(cell, row)) + " |" for row in [head, align, *rows])


def guarded(section, result):
    """A section, or `missing` where what was measured is not as it should be."""
    try:
        return section(result)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, ZeroDivisionError):
        return MISSING


def number(value, digits=2, scale=1.0):
    return f"{value * scale:.{digits}f}" if isinstance(value, (int, float)) else "-"


def psnr(result, name):
    training = result["measured"].get(name)
    return number(training["psnr"]) if training and training.get("psnr") is not None else MISSING


def view_ms(result):
    """The median view; the first one also loads the kernels."""
    render = result["measured"].get("render")
    return number(statistics.median(render["seconds"][1:] or render["seconds"]), 1, 1e3) if render else MISSING


def side(result):
    """Pixels along a side of the photos and views that were measured."""
    return 100 if result["rehearsal"] else 800


def checks(result):
    verdicts = {}
    for name, path in CHECKS.items():
        check = result["measured"].get(name)
        broken = [kernel["name"] for kernel in check["kernels"] if not kernel["pass"]] if check else None
        verdicts[path] = MISSING if check is None else "wrong: " + ", ".join(broken) if broken else "right"
    return verdicts


def ceilings_section(result):
    ceilings = result["measured"].get("ceilings")
    if not ceilings:
        return MISSING
    rows = [
        ["multiply-adds, TFLOP/s", number(ceilings.get("flops_per_second"), 3, 1e-12)],
        ["copy, read and written, GB/s", number(ceilings.get("copied_bytes_per_second"), 1, 1e-9)],
    ]
    for size, rate in ceilings.get("gathers_per_second", {}).items():
        rows.append([f"gathers of 8 bytes from {size}, G/s", number(rate, 2, 1e-9)])
    for kind, rate in ceilings.get("atomics_per_second", {}).items():
        rows.append([f"atomics at random addresses, {kind}, G/s", number(rate, 2, 1e-9)])
    for key, name in [("dispatch", "a dispatch behind another"), ("submission", "submit and wait"), ("read_back", "read-back")]:
        rows.append([f"{name}, µs", number(ceilings.get(f"{key}_seconds"), 1, 1e6)])
    return table(["ceiling", "measured"], rows)


def throughput(step):
    """Milliseconds of a step, millions of kept samples per second."""
    sums = step["throughput"]
    return 1e3 * sums["seconds"] / max(sums["steps"], 1), sums["samples_per_second"] / 1e6


def step_section(result):
    step = result["measured"].get("step")
    if not step:
        return MISSING
    sums, batch = step["throughput"], step["config"]["batch"]
    ms, rate = throughput(step)
    per_step = {key: sums[key] // max(sums["steps"], 1) for key in ("rays", "marched", "samples")}
    lines = [
        f"On {step['dataset']}: {ms:.2f} ms a step, {rate:.1f} million kept samples a second: {per_step['rays']} rays, {per_step['marched']} marched and "
        f"{per_step['samples']} kept samples of {batch['kept']} a step, {step['device_bytes'] / 2**20:.0f} MiB on the device.",
    ]
    if step["cold_start"]:
        start = step["cold_start"]
        lines.append(f"From a cold start, the first step ends after {start['seconds']:.2f} s; kernels take {start['kernels_seconds']:.2f} s of it.")
    for views in step.get("views", []):
        lines.append(
            f"Views of {views['width']}x{views['height']} pixels, without files, {views['rays']} rays and {views['samples']} samples a round: "
            f"{number(views['seconds'], 1, 1e3)} ms each, {number(views['device_seconds'], 1, 1e3)} of it on the device in "
            f"{number(views['rounds'], 1)} rounds; the first one {number(views['first_seconds'], 1, 1e3)}."
        )
    rows = []
    for stage in step["stages"]:
        work, ceiling = stage["work"] or {}, stage["ceiling"]
        rates = [work.get(kind, 0) / max(stage["ms_per_step"], 1e-9) / 1e6 for kind in ("flops", "bytes", "gathers", "atomics")]
        rows.append([
            stage["stage"],
            number(stage["ms_per_step"], 3),
            number(stage["share"], 1, 100),
            *(number(rate, 1) if rate > 0 else "-" for rate in rates),
            f"{100 * ceiling['share']:.0f} % {ceiling['bound_by']}" if ceiling else "-",
        ])
    head = ["stage", "ms", "%", "GFLOP/s", "GB/s", "G gathers/s", "G atomics/s", "of the ceiling"]
    timed = "timestamps" in (result["adapter"] or {}).get("features", ["timestamps"])
    without = f"Stages: {MISSING}" if timed else "The adapter has no timestamps: stages are not timed."
    lines.append(table(head, rows) if rows else without)
    return "\n\n".join(lines)


def sweeps_section(result):
    names = [name for name in result["parts"] if name.startswith("sweep_")]
    rows = []
    for name in ["step", *names]:
        step = result["measured"].get(name)
        cells = [MISSING] * 3
        if step:
            cells = [*(number(value) for value in throughput(step)), number(step["device_bytes"], 0, 2**-20)]
        rows.append([name.replace("sweep_", "").replace("_", " "), *cells])
    return table(["setting", "ms a step", "M samples/s", "MiB on the device"], rows)


def training_runs_section(result):
    rows = []
    for name in (name for name in result["parts"] if name.startswith("train_")):
        run = result["measured"].get(name)
        cells = [MISSING] * 6
        if run and run.get("psnr") is not None:
            cells = [number(run["seconds"], 1), run["steps"], number(run["psnr"]), number(run["ssim"], 4), run["views"], run["skipped"]]
        rows.append([name.removeprefix("train_").replace("_", " "), *cells])
    return table(["training", "seconds", "steps", "PSNR, dB", "SSIM", "views", "skipped steps"], rows)


def report(result):
    adapter = result["adapter"]
    title = f"{adapter['name']} over {adapter['backend']}, {result['date']}" if adapter else f"no adapter, {result['date']}"
    features = ", ".join(adapter["features"]) if adapter else MISSING
    matrices = [f"{size['m']}x{size['n']}x{size['k']} {size['factors']} into {size['sums']}" for size in (adapter or {}).get("cooperative_matrices", [])]
    parts = [[name, part["status"], part.get("reason", ""), part.get("seconds", "-")] for name, part in result["parts"].items()]
    sections = {
        None: "\n".join([
            f"- Driver: {adapter['driver'] if adapter else MISSING}",
            f"- Features: {features}; subgroups of {adapter['subgroup_sizes'] if adapter else MISSING}",
            f"- Cooperative matrices: {'; '.join(matrices) or 'none'}",
            f"- Machine: {', '.join(result['machine'])}",
            f"- Commit: {result['commit']}",
            "- Command: `gpu.sh` of `scripts/bundle.sh`" + (", a rehearsal with tiny budgets" if result["rehearsal"] else ""),
        ]),
        "Are the kernels right?": "\n".join([
            *(f"- `nerf check`, {path}: {verdict}" for path, verdict in checks(result).items()),
            f"- Kernel tests: {result['kernel_tests']['verdict']}{''.join(' ' + name for name in result['kernel_tests']['failed'])}",
            f"- `--deterministic` twice: {result['deterministic']}",
        ]),
        "What the adapter can do": guarded(ceilings_section, result),
        f"A step of the GPU defaults, generated photos of {side(result)}x{side(result)} pixels": guarded(step_section, result),
        "Other settings": guarded(sweeps_section, result),
        "Training runs, all test views": guarded(training_runs_section, result),
        "Rendering": f"A view of {side(result)}x{side(result)} pixels, median: {guarded(view_ms, result)} ms.",
        "What ran": table(["part", "status", "why", "seconds"], parts, left=3),
    }
    return f"# {title}\n" + "".join(f"\n{'## ' + name + chr(10) * 2 if name else ''}{text}\n" for name, text in sections.items())


def lego(result):
    """Of how many pixels a side lego is."""
    sides = [name.split("_", 1)[1] for name in result.get("datasets", []) if name.startswith("lego_")]
    return f"{sides[0]} px: " if sides else ""


def readme_row(result):
    adapter, step = result["adapter"], result["measured"].get("step")
    verdicts = checks(result)
    right = "right" if set(verdicts.values()) == {"right"} else "; ".join(f"{path} {verdict}" for path, verdict in verdicts.items() if verdict != "right")
    return [
        f"[{adapter['name']}](benches/results/{result['folder']}/report.md)" if adapter else MISSING,
        result["date"],
        right,
        result["deterministic"],
        guarded(lambda _: number(throughput(step)[0]), result),
        lego(result) + " / ".join(psnr(result, f"train_lego_{budget}s") for budget in BUDGETS),
        " / ".join(psnr(result, f"train_scene_{budget}s") for budget in BUDGETS),
        psnr(result, "train_fox_12s"),
        guarded(view_ms, result),
    ]


def readme_table(results):
    rows = []
    for path in sorted(results.glob("*/gpu.json")):
        try:
            result = {**json.loads(path.read_text(encoding="utf-8")), "folder": path.parent.name}
            if not result["rehearsal"] and (result["adapter"] or {}).get("kind") != "Cpu":
                rows.append(readme_row(result))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            print(f"warning: {path} is left out: {type(error).__name__} {error}", file=sys.stderr)
    budgets = " / ".join(BUDGETS)
    head = [
        "adapter", "date", "`nerf check`", "`--deterministic` twice", "ms a step", f"lego after {budgets} s, dB",
        f"toys after {budgets} s, dB", "fox after 12 s, dB", "800x800 view, ms",
    ]
    rows = rows or [["none yet", *["-"] * (len(head) - 1)]]
    return table(head, rows, left=4)


def write(path, text):
    with open(path, "w", encoding="utf-8", newline="") as file:
        file.write(text)


def free_folder(results, name, result):
    """A folder that holds nothing yet, or the same result."""
    for number in range(1, 1000):
        folder = results / (name if number == 1 else f"{name}_{number}")
        try:
            if json.loads((folder / "gpu.json").read_text(encoding="utf-8")) == result:
                return folder
        except FileNotFoundError:
            return folder
        except ValueError:
            pass
    sys.exit(f"error: {results} has a thousand folders called {name}")


def main():
    if not 2 <= len(sys.argv) <= 4:
        sys.exit(__doc__.split("\n\n")[1])
    root = Path(__file__).resolve().parent.parent
    results = Path(sys.argv[2]) if len(sys.argv) > 2 else root / "benches/results"
    readme = Path(sys.argv[3]) if len(sys.argv) > 3 else root / "README.md"
    try:
        files = read(sys.argv[1])
    except (OSError, EOFError, zlib.error, tarfile.TarError) as error:
        sys.exit(f"error: expected an archive of scripts/gpu.sh, found {sys.argv[1]}: {error}")
    if "meta.txt" not in files:
        sys.exit(f"error: {sys.argv[1]} has no meta.txt: it is no archive of scripts/gpu.sh")
    result = collect(files)
    name = result["adapter"]["name"].split("(")[0] if result["adapter"] else "no adapter"
    slug = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:60] or "unnamed"
    folder = free_folder(results, f"{result['date']}_{slug}{'_rehearsal' if result['rehearsal'] else ''}", result)
    folder.mkdir(parents=True, exist_ok=True)
    write(folder / "gpu.json", json.dumps(result, indent=1) + "\n")
    write(folder / "report.md", report(result))
    if "kernels.txt" in files:
        write(folder / "kernels.txt", files["kernels.txt"])
    print(folder / "report.md")
    with open(readme, encoding="utf-8", newline="") as file:
        text = file.read()
    if BEGIN not in text or END not in text:
        sys.exit(f"error: {readme} has no lines '{BEGIN}' and '{END}'; the table is not written")
    before, rest = text.split(BEGIN, 1)
    end = "\r\n" if "\r\n" in text else "\n"
    lines = [BEGIN, *readme_table(results).splitlines(), END]
    write(readme, before + end.join(lines) + rest.split(END, 1)[1])


if __name__ == "__main__":
    main()
