"""The figures: how each is measured, step by step, and the rows that its steps come to."""

import json
import pathlib
import re
import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass, field

EXAM = "assets/exams/obstetric_sweep.mcap"


@dataclass
class Step:
    """A command, and how what it left in its folder becomes values."""

    name: str
    command: list
    # Called with the step's folder and the command's peak of resident memory, KiB.
    collect: Callable
    # Exit codes of a measuring that counts.
    codes: tuple = (0,)


@dataclass
class Figure:
    """A figure. `steps` is called with the checkout, the program and the folder of the figure's steps."""

    name: str
    what: str
    command: str
    steps: Callable
    # Called with the finished steps; returns `rows`, and further entries of the data file.
    summary: Callable
    # Files of the figure's folder that are kept in the checkout, with their paths there.
    files: dict = field(default_factory=dict)


def read(path):
    return json.loads(pathlib.Path(path).read_text())


def one_row_each(steps):
    """A row a step: its name and values."""
    return {"rows": [{"name": step["step"], **step["values"]} for step in steps]}


def demo_steps(options):
    def steps(tree, program, folder):
        command = [program, "demo", *options, "--out", folder / "demo"]
        return [Step("demo", command, lambda _, __: read(folder / "demo/times.json"))]

    return steps


def passes_summary(steps):
    times = steps[0]["values"]
    found = {quality: {entry["stage"]: entry for entry in times[f"times_{quality}"]} for quality in ("lq", "hq")}
    names = list(found["lq"]) + [stage for stage in found["hq"] if stage not in found["lq"]]
    rows = [
        {"stage": name} | {f"{quality}_{key}": found[quality].get(name, {}).get(key) for quality in found for key in ("p50_ms", "p95_ms")}
        for name in names
    ]
    return {"frames_lq": times["frames_lq"], "frames_hq": times["frames_hq"], "triangles": times["triangles"], "rows": rows}


def demo_summary(steps):
    times = steps[0]["values"]
    live = times["live"]
    latency, points = live["pose_to_present"] or {}, live["points"] or {}
    row = {
        "frames_per_s": live["frames_per_s"],
        "ticks_percent": 100 * live["produced"] / max(1, live["produced"] + live["missed_ticks"]),
        "p50_ms": latency.get("p50_ms"),
        "p99_ms": latency.get("p99_ms"),
        "generated_percent": 100 * live["generated_ratio"],
        "begun": points.get("begun"),
        "ended": points.get("ended"),
        "wall_s": times["wall_s"],
    }
    return {"rows": [row]}


TRADEOFF_FILES = ["tradeoff.csv", "tradeoff.svg", "tradeoff.png", "tradeoff.md", "effects.csv", "looks.csv"]


def tradeoff_steps(_, program, folder):
    command = [program, "tradeoff", "configs/generators.toml", "--poses", "1", "--resume", "--out", folder / "tradeoff"]
    return [Step("tradeoff", command, lambda _, __: read(folder / "tradeoff/tradeoff.json"))]


def tradeoff_summary(steps):
    # The step's values hold all of it, by tissue, too; the rows are enough to keep.
    report = steps[0].pop("values")
    rows = []
    for point in report["points"]:
        knobs, time, error = point["knobs"], point["time"], point["error"]
        row = {"name": point["name"], "generator": point["generator"], "on_front": point["on_front"]}
        row |= {"median_ms": time["median_ms"], "p95_ms": time["p95_ms"]}
        row |= {"seen": error["seen"]["whole"], "levels": error["seen"]["levels"], "texture": error["seen"]["texture"]}
        row |= {"rmse": error["rmse"], "psnr_db": error["psnr_db"], "ssim": error["ssim"]}
        rows.append(row | {"all_effects": bool(knobs["all_effects"])})
    effects = [
        {"name": e["effect"], "without": e["without"], "with": e["with"], "cost_ms": e["cost_ms"]} for e in report["effects"]
    ]
    return {"reference": report["reference"], "effects": effects, "rows": rows}


LOOKS = [
    ("plain", ["--effect", "contact=off", "--effect", "texture=off", "--effect", "clutter=off", "--effect", "noise=off"], None),
    ("raw", [], None),
    ("survey", [], "survey"),
]


def looks_steps(tree, program, folder):
    steps = []
    for turn in range(1, 4):
        for name, options, preset in LOOKS:
            station = folder / f"{name}.toml"
            text = (tree.root / "configs/obstetric.toml").read_text()
            station.write_text(text + (f'\n[look]\npreset = "{preset}"\n' if preset else ""))
            metrics = folder / f"{name}_{turn}.jsonl"
            command = [program, "run", station, "--replay", EXAM, "--sink", "null", "--no-generator", "--duration", "14"]
            command += ["--metrics", metrics, "--force", *options]
            steps.append(Step(f"{name}_{turn}", command, lambda _, __, metrics=metrics: frame_times(metrics)))
    return steps


def frame_times(metrics):
    """Times of each frame, tenths of a ms are enough: rendering, and what follows until it is shown."""
    lines = [json.loads(line) for line in metrics.read_text().splitlines()]
    frames = [line for line in lines if "summary" not in line]
    return {
        "render_ms": [round(f["rendered_ms"] - f["submitted_ms"], 2) for f in frames],
        "look_ms": [round(f["presented_ms"] - f["rendered_ms"], 2) for f in frames],
    }


def looks_summary(steps):
    rows = []
    for name, _, _ in LOOKS:
        turns = [step["values"] for step in steps if step["step"].startswith(f"{name}_")]
        render = [ms for turn in turns for ms in turn["render_ms"]]
        look = [ms for turn in turns for ms in turn["look_ms"]]
        row = {"name": name, "frames": len(render), "render_ms": statistics.median(render), "look_ms": statistics.median(look)}
        rows.append(row | {"both_ms": statistics.median(a + b for a, b in zip(render, look))})
    return {"rows": rows}


def memory_steps(_, program, folder):
    return [
        Step(
            quality,
            [program, "render", "configs/obstetric.toml", "--quality", quality, "--out", folder / quality / "frame"],
            lambda _, peak_kib: {"peak_mb": peak_kib * 1024 / 1e6},
        )
        for quality in ("lq", "hq")
    ]


def generators_steps(tree, program, _):
    # A model in another precision has no manifest of its own.
    found = sorted((tree.root / "assets/generators").glob("*/*.onnx"))
    models = [model for model in found if model.with_suffix(".toml").is_file()]
    return [
        Step(model.stem, [program, "generator", model, "--json"], lambda folder, _: read(folder / "stdout.txt")["times"])
        for model in models
    ]


def station_copy(tree, path, change):
    """A copy of `configs/live.toml` at `path`, changed; its paths lead to the checkout."""
    text = (tree.root / "configs/live.toml").read_text()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(change(text).replace('"../', f'"{tree.root}/'))
    return path


def with_key(text, table, key, value):
    """The text with a key of a table set to a value."""
    found = re.search(rf"(?ms)^\[{table}\]\n.*?(?=^\[|\Z)", text)
    changed, count = re.subn(rf"(?m)^{key}\s*=.*$", f"{key} = {value}", found[0], count=1)
    if count == 0:
        raise ValueError(f"configs/live.toml has no {key} in [{table}]")
    return text[: found.start()] + changed + text[found.end() :]


def soak_step(tree, program, folder, name, options, rate_hz=14, frame_budget_ms=64):
    """A session of scripts/soak, whose faults are kept with its figures."""
    change = lambda text: with_key(with_key(text, "pipeline", "frame_rate_hz", rate_hz), "quality", "frame_budget_ms", frame_budget_ms)  # noqa: E731
    station = station_copy(tree, folder / f"{name}.toml", change)
    command = [sys.executable, "scripts/soak", "--program", program, "--station", station, "--out", folder / name, *options]
    asked = {"rate_hz": rate_hz, "asked_frame_budget_ms": frame_budget_ms}
    return Step(name, command, lambda step, _: asked | read(step / "figures.json"), codes=(0, 1))


def live_steps(tree, program, folder):
    asked = [(10, 90), (14, 64), (20, 45), (30, 30)]
    return [soak_step(tree, program, folder, f"{hz}_hz", ["--minutes", "1.5"], hz, ms) for hz, ms in asked]


def soak_steps(*options):
    return lambda tree, program, folder: [soak_step(tree, program, folder, "live", options)]


def live_error_steps(tree, program, folder):
    def fixed(text):
        text = with_key(text, "generator", "models", '["../assets/generators/fast_m/fast_m.onnx"]\nrun_budget_ms = 4000')
        return re.sub(r"(?ms)^\[quality\]\n.*?(?=^\[)", "[quality]\nrays = 1\nlayers = 1\n\n", text)

    stations = [
        station_copy(tree, folder / "fixed.toml", fixed),
        station_copy(tree, folder / "live.toml", lambda text: text),
    ]
    return [
        Step(
            station.stem,
            [sys.executable, "scripts/live-error", station, "--program", program, "--out", folder / "live-error",
             "--json", folder / f"{station.stem}.json"],
            lambda _, __, station=station: read(folder / f"{station.stem}.json")[0],
        )
        for station in stations
    ]


# Second pose of the moves: one that a second datagram must confirm, and one within the reach of a hand.
MOVES = {"jump": "0,30,80,0,1,0,0", "reach": "0,-20,79,0,1,0,0"}


def latency_steps(_, program, folder):
    return [
        Step(
            name,
            [sys.executable, "scripts/latency", "--to", to, "--program", program, "--out", folder / name, "--json", folder / f"{name}.json"],
            lambda _, __, name=name: read(folder / f"{name}.json"),
        )
        for name, to in MOVES.items()
    ]


FIGURES = {
    figure.name: figure
    for figure in [
        Figure("passes", "passes of a frame, LQ and HQ", "insonify demo --no-live", demo_steps(["--no-live"]), passes_summary),
        Figure("demo", "the demo's live part, and how long all of it takes", "insonify demo --once", demo_steps(["--once"]), demo_summary),
        Figure("tradeoff", "time against error: rays, layers, angles, generators", "insonify tradeoff configs/generators.toml --poses 1",
               tradeoff_steps, tradeoff_summary, {f"tradeoff/{name}": f"docs/tradeoff/{name}" for name in TRADEOFF_FILES}),
        Figure("looks", "contact, texture, noise and looks",
               f"insonify run STATION --replay {EXAM} --sink null --no-generator --metrics FILE", looks_steps, looks_summary),
        Figure("memory", "peak of resident memory", "insonify render configs/obstetric.toml --quality QUALITY", memory_steps, one_row_each),
        Figure("generators", "a picture of 1386 x 1000 by each shipped generator", "insonify generator MODEL", generators_steps, one_row_each),
        Figure("live", "live sessions of four rates", "scripts/soak --station STATION --minutes 1.5", live_steps, one_row_each),
        Figure("live_error", "error of live pictures", "scripts/live-error STATION", live_error_steps, one_row_each),
        Figure("latency", "a move of the probe until its picture is at the page, from outside", "scripts/latency --to POSE",
               latency_steps, one_row_each),
        Figure("live_page", "a live session with its page on the same cores", "scripts/soak --station STATION --page --minutes 3",
               soak_steps("--page", "--minutes", "3"), one_row_each),
        Figure("live_load", "a live session under a load that comes and goes",
               "scripts/soak --station STATION --busy 2 --busy-s 20 --minutes 8",
               soak_steps("--busy", "2", "--busy-s", "20", "--minutes", "8"), one_row_each),
    ]
}
