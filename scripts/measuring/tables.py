"""Markdown of figures, from their data files. The name of a table stands in its marker."""

from .store import FigureError


def number(value, digits=1, unit=""):
    """A number with thousands separated; a dash where it was not measured."""
    return "–" if value is None else f"{value:,.{digits}f}{unit}"


def table(head, rows):
    """A table; columns whose heading ends in `:` are aligned to the right."""
    bar = ["---:" if name.endswith(":") else "---" for name in head]
    lines = [[name.removesuffix(":") for name in head], None, *rows]
    return "\n".join(f"|{'|'.join(bar)}|" if line is None else "| " + " | ".join(line) + " |" for line in lines)


def origin(data):
    """Processor, cores, commit and date."""
    machine = data["machine"]
    return f"{machine['processor']}, {machine['cores']} cores, commit `{data['commit']}`, {data['date']}"


def caption(data, text=""):
    """What was measured, and where it comes from, as the line below a table."""
    return f"*`{data['command']}`{text}. {origin(data)}.*"


def point(name):
    """Name of an operating point, as in text."""
    words = (name or "–").split(" ")
    return " ".join(word.replace("x", " × ") if word.replace("x", "").isdigit() else word for word in words)


def passes(data):
    rows = []
    for row in data["rows"]:
        if row["stage"] == "upload, submit, read back":
            continue
        cells = [row["stage"], *(number(row[f"{quality}_{key}_ms"]) for quality in ("lq", "hq") for key in ("p50", "p95"))]
        whole = row["stage"] == "whole frame"
        rows.append([f"**{cell}**" if whole and column in (0, 1, 3) else cell for column, cell in enumerate(cells)])
    made = f": {data['frames_lq']} frames at LQ (1 × 1) and {data['frames_hq']} at HQ (32 × 3), {data['triangles']:,} triangles, ms"
    return table(["pass", "LQ p50:", "LQ p95:", "HQ p50:", "HQ p95:"], rows) + "\n\n" + caption(data, made)


def demo(data):
    row = data["rows"][0]
    cells = [number(row["frames_per_s"]), number(row["ticks_percent"], 1, " %"), number(row["p50_ms"], 0), number(row["p99_ms"], 0)]
    cells += [point(row["begun"]), number(row["generated_percent"], 0, " %"), number(row["wall_s"], 0)]
    head = ["live frames/s:", "ticks kept:", "pose to present, ms: p50:", "p99:", "begins with", "generated:", "whole demo, s:"]
    return table(head, [cells]) + "\n\n" + caption(data)


# Points of the README's table, with their names there.
SHOWN = {
    "1x1 no aperture": "1 × 1, without `aperture`",
    "1x1": "1 × 1 (LQ)",
    "1x1 9 rolling angles": "1 × 1, 9 rolling",
    "1x3 9 rolling angles": "1 × 3, 9 rolling",
    "2x3 9 rolling angles": "2 × 3, 9 rolling",
    "4x3 9 rolling angles": "4 × 3, 9 rolling",
    "1x1 + fast_msa": "LQ + `fast_msa`",
    "1x1 + beam_msa": "LQ + `beam_msa`",
    "4x3 of 9 angles + beam_m_rolling": "4 × 3, 9 rolling + `beam_m_rolling`",
    "8x3 of 9 angles + beam_m_rolling": "8 × 3, 9 rolling + `beam_m_rolling`",
    "2x3 of 9 angles + fast_m_rolling": "2 × 3, 9 rolling + `fast_m_rolling`",
    "8x3 9 rolling angles": "8 × 3, 9 rolling",
    "8x3 of 9 angles + fast_m_rolling": "8 × 3, 9 rolling + `fast_m_rolling`",
    "32x3": "32 × 3 (HQ)",
    "8x3 9 angles": "8 × 3, 9 angles",
}


def by_name(data):
    return {row["name"]: row for row in data["rows"] if not row["all_effects"]}


def tradeoff(data):
    found = by_name(data)
    shown = sorted((found[name] | {"shown": shown} for name, shown in SHOWN.items() if name in found), key=lambda row: row["median_ms"])
    rows = [
        [row["shown"], *(number(row[key]) for key in ("median_ms", "seen", "levels", "texture"))]
        for row in shown
    ]
    return table(["rays × layers, angles", "ms a frame:", "seen error:", "levels:", "texture:"], rows)


# Budget of configs/live.toml, ms.
FRAME_BUDGET_MS = 64


def shown_point(row):
    """Name of a point in the README's table, with its seen error."""
    name = SHOWN.get(row["name"], f"`{row['name']}`")
    return f"{name} ({number(row['seen'])} grey levels)"


def tradeoff_summary(data):
    rows = [row for row in data["rows"] if not row["all_effects"]]
    within = [row for row in rows if row["p95_ms"] <= FRAME_BUDGET_MS]
    nearest = lambda chosen: min(chosen, key=lambda row: row["seen"], default=None)  # noqa: E731
    plain = nearest([row for row in within if not row["generator"]])
    translated = nearest([row for row in within if row["generator"]])
    first, second = plain, translated
    if plain is None or (translated is not None and translated["seen"] < plain["seen"]):
        first, second = translated, plain
    best = f"Within the {FRAME_BUDGET_MS} ms of `configs/live.toml` "
    best += "no point keeps its p95" if first is None else f"the best point is {shown_point(first)}"
    if second is not None:
        best += f". The best with{'' if second['generator'] else 'out'} a generator is {shown_point(second)}"
    effect = next(row for row in data["effects"] if row["name"] == "aperture")
    reference = data["reference"]
    sentences = [
        f"**{best}.**",
        f"The effect `aperture` lowers the error of a shadow from {effect['without']:.1f} to {effect['with']:.1f} dB, at a cost of "
        f"{effect['cost_ms'][0]:.0f} ms a frame.",
        f"The reference is{'' if reference['converged'] else ' not'} converged. "
        f"Doubling its rays to {reference['rays']} changes a pixel by {reference['rays_change']:.1f} grey levels on average. "
        f"With {reference['layers_compared']} layers instead of {reference['layers']}, means of blocks of 32 × 32 pixels change by "
        f"{reference['layers_change']:.1f}.",
        f"{origin(data)}, with maps.",
    ]
    return "\n".join(sentences)


def cost(effect):
    """Time that an effect adds to a frame; a difference within its spread is none."""
    ms, spread_ms = effect["cost_ms"]
    return f"less than {spread_ms:.1f} ms" if ms <= spread_ms else f"{ms:.1f} ms"


def points(data):
    found = by_name(data)
    ms = lambda name: number(found[name]["median_ms"]) if name in found else ""  # noqa: E731
    rows = [
        [name.replace("x", " × "), ms(f"{name} no aperture"), ms(name), ms(f"{name} 9 rolling angles")]
        for name in ("1x1", "1x3", "2x3", "4x3", "8x3", "32x3")
        if name in found
    ]
    # An effect is compared with theory several times; its cost is measured once.
    costs = {row["name"]: cost(row) for row in data["effects"] if row["cost_ms"]}
    costs = ", ".join(f"`{name}` {text}" for name, text in costs.items())
    text = f": medians with maps, ms. Of these, effects take at 1 × 1: {costs}"
    return table(["rays × layers", "without `aperture`:", "with it:", "of 9 rolling angles:"], rows) + "\n\n" + caption(data, text)


LOOKS = {
    "plain": "without `contact`, `texture`, `clutter`, `noise`",
    "raw": "with them, look `raw` (the default)",
    "survey": "look `survey`: three angles, smoothing, persistence, contrast",
}


def looks(data):
    first = data["rows"][0]["both_ms"]
    rows = [
        [LOOKS[row["name"]], *(number(row[key]) for key in ("render_ms", "look_ms", "both_ms")), f"{row['both_ms'] / first:.2f}"]
        for row in data["rows"]
    ]
    frames = round(min(row["frames"] for row in data["rows"]), -2)
    text = f": `configs/obstetric.toml`, three turns of 14 s each, about {frames:,} frames a row, medians, ms"
    return table(["", "render:", "look:", "both:", "ratio:"], rows) + "\n\n" + caption(data, text)


def memory(data):
    rows = [[row["name"].upper(), number(row["peak_mb"], 0)] for row in data["rows"]]
    return table(["quality", "peak, MB:"], rows) + "\n\n" + caption(data, ": peak of resident memory")


def generators(data):
    rows = [
        [f"`{row['name']}`", number(row["min_ms"]), number(row["p50_ms"]), number(row["p95_ms"])]
        for row in sorted(data["rows"], key=lambda row: row["p50_ms"])
    ]
    first = data["rows"][0]
    text = f": {first['runs']} pictures of {first['width']} × {first['height']} each, ms"
    return table(["generator", "least:", "p50:", "p95:"], rows) + "\n\n" + caption(data, text)


def live(data):
    rows = [
        [
            f"{row['rate_hz']} Hz, {row['asked_frame_budget_ms']} ms", point(row["begun"]), point(row["most"]),
            number(row["ticks_percent"], 1, " %"), number(row["p50_ms"], 0), number(row["p99_ms"], 0), str(row["changes"]),
            number(row["over_percent"], 1, " %"),
        ]
        for row in data["rows"]
    ]
    head = ["asked for", "begins with", "most frames", "ticks kept:", "pose to present, ms: p50:", "p99:", "changes:", "over the budget:"]
    return table(head, rows) + "\n\n" + caption(data, ": `configs/live.toml` with its rate and budget changed")


def session(data):
    """The row of one session of scripts/soak."""
    row = data["rows"][0]
    cells = [number(row["ticks_percent"], 1, " %"), number(row["p50_ms"], 0), number(row["p99_ms"], 0), number(row["longest_gap_ms"], 0)]
    cells += [str(row["changes_a_minute"]), number(row["over_percent"], 1, " %")]
    head = ["ticks kept:", "pose to present, ms: p50:", "p99:", "longest gap, ms:", "changes a minute, at most:", "over the budget:"]
    text = f": {row['rate_hz']} Hz, {row['asked_frame_budget_ms']} ms"
    return table(head, [cells]) + "\n\n" + caption(data, text)


MOVES = {"jump": "beyond a hand's reach", "reach": "within it"}


def latency(data):
    times = lambda values, *keys: [number(values and values[f"{key}_ms"], 0) for key in keys]  # noqa: E731
    rows = []
    for row in data["rows"]:
        stated = row["all_frames"]["motion_to_present"] if row["name"] == "reach" else row["stated_jump_to_present"]
        cells = [f"{number(row['distance_mm'], 0)} mm, {MOVES[row['name']]}", *times(row["outside"], "p50", "p95", "max")]
        rows.append([*cells, *times(stated, "p50", "p95"), *times(row["all_frames"]["pose_to_present"], "p50", "p95")])
    head = ["move", "outside, ms: p50:", "p95:", "max:", "stated with its waits: p50:", "p95:", "pose to present: p50:", "p95:"]
    first = data["rows"][0]
    poses = " and ".join(dict.fromkeys(f"{row['poses_hz']:g}" for row in data["rows"]))
    text = f": `configs/live.toml` at {first['rate_hz']:g} Hz and {poses} poses/s, {first['moves']} moves a row"
    loads = [row["busy_before_percent"] for row in data["rows"] if row["busy_before_percent"] is not None]
    if loads:
        text += f"; before each row other programs took {' and '.join(number(load, 0) for load in loads)} % of the processors"
    return table(head, rows) + "\n\n" + caption(data, text)


STATIONS = {"fixed": "1 × 1 with a generator for single angles", "live": "`configs/live.toml`"}


def live_error(data):
    rows = [
        [STATIONS[row["name"]], number(row["error"]), number(row["ticks_percent"], 1, " %"), number(row["p50_ms"], 0), number(row["p99_ms"], 0)]
        for row in data["rows"]
    ]
    head = ["", "error, grey levels:", "ticks kept:", "pose to present, ms: p50:", "p99:"]
    text = ": the exam once at 14 Hz, 12 of its pictures against stills of 64 × 3 of nine angles at the same poses"
    return table(head, rows) + "\n\n" + caption(data, text)


# Table: its data file and its renderer.
def whole_frame(row):
    return next(stage for stage in row["stages"] if stage["stage"] == "whole frame")


def gpu(data):
    rows = []
    for row in data["rows"]:
        paths = " × ".join(row["quality"].split("x"))
        shape = [" × ".join(map(str, row[key])) for key in ("lines", "image")]
        whole = whole_frame(row)
        cells = [row["name"], paths, *shape, "yes" if row["maps"] else "no"]
        rows.append([*cells, number(whole["p50_ms"], 2), number(whole["p95_ms"], 2), number(row["frames_per_s"], 0)])
    head = ["frames", "rays × layers", "samples", "image", "maps", "p50, ms:", "p95, ms:", "frames/s:"]
    return table(head, rows) + "\n\n" + caption(data, ": 674 k triangles, 200 frames of each kind")


def gpu_passes(data):
    rows = data["rows"][:4]
    stages = [{stage["stage"]: stage["p50_ms"] for stage in row["stages"]} for row in rows]
    names = list(dict.fromkeys(name for found in stages for name in found))
    cells = [[name, *(number(found.get(name), 2) for found in stages)] for name in names]
    return table(["median, ms", *(f"{row['name']}:" for row in rows)], cells) + "\n\n" + caption(data)


def trained(data):
    rows = []
    for row in data["rows"]:
        name = f"input, `{row['data']}`" if row["name"] == "LQ" else f"`{row['name']}`"
        cells = [number(row["psnr_db"], 2), number(row["psnr_db_worst"], 2), number(100 * row["ssim"]), number(100 * row["pkl"]), number(100 * row["pkl_worst"])]
        cells += [number(row["fd"], 2), number(row["seen"], 2), number(row["levels"], 2), number(row["texture"], 2)]
        rows.append([name, *cells, "–" if row["name"] == "LQ" else "yes" if row["may_ship"] else "no"])
    head = ["", "PSNR, dB:", "5 %:", "SSIM, %:", "pKL ×100:", "95 %:", "FD texture64:", "seen error:", "levels:", "texture:", "passes:"]
    each = [f"{of['pairs']['frames']} pairs rendered in {of['seconds']['render']:.0f} s, {of['trainings']} trained side by side in {of['seconds']['train']:.0f} s" for of in data["plans"]]
    made = ": " + ", then ".join(each)
    judged = f"; judged by {data['judged']}" if "judged" in data else ""
    return table(head, rows) + "\n\n" + caption(data, made + judged)


def gpu_host(data):
    names = [name for name in data["host"][0]["whole_ms"] if name in ("LQ", "LQ without maps", "HQ")]
    cells = [[str(row["threads"]), *(number(row["whole_ms"][name]) for name in names)] for row in data["host"]]
    processor = data["machine"]["processor"].rsplit(", ", 1)[-1]
    made = f"*`insonify bench configs/obstetric.toml --backend host`: medians, ms. {processor}, {data['machine']['cores']} cores, commit `{data['commit']}`, {data['date']}.*"
    return table(["threads", *(f"{name}:" for name in names)], cells) + "\n\n" + made


TABLES = {
    "gpu": ("gpu", gpu),
    "gpu_passes": ("gpu", gpu_passes),
    "gpu_host": ("gpu", gpu_host),
    "trained": ("trained", trained),
    "passes": ("passes", passes),
    "demo": ("demo", demo),
    "tradeoff": ("tradeoff", tradeoff),
    "tradeoff_summary": ("tradeoff", tradeoff_summary),
    "points": ("tradeoff", points),
    "looks": ("looks", looks),
    "memory": ("memory", memory),
    "generators": ("generators", generators),
    "live": ("live", live),
    "live_page": ("live_page", session),
    "live_load": ("live_load", session),
    "live_error": ("live_error", live_error),
    "latency": ("latency", latency),
}


def rendered(tree, name):
    """Markdown of a table."""
    if name not in TABLES:
        raise FigureError(f"no table is named {name}; they are {', '.join(TABLES)}")
    of, render = TABLES[name]
    data = tree.load(of)
    if data is None:
        raise FigureError(f"the figure {of} has no data: scripts/figures {of} measures it")
    try:
        return render(data)
    except (KeyError, IndexError, TypeError, StopIteration) as error:
        raise FigureError(f"docs/figures/{of}.json doesn't hold what the table {name} needs: {error!r}") from None
