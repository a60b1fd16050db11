"""What gpu-train keeps of a visit: generators in assets/, figures in docs/."""

import json
import shutil
import sys

from . import documents, store
from .visit import VisitError


def chosen(result, report, name):
    """Folder of the exported generator NAME of a result, which may be shipped."""
    rows = {row: figures for rows in report.get("judged", {}).values() for row, figures in rows.items() if row != "LQ"}
    if name not in rows:
        raise VisitError(f"{result}: no training is named {name}; there are {', '.join(rows)}", 2)
    if not rows[name]["may_ship"]:
        raise VisitError(f"{name}: its pKL or its distance of textures is worse than its input's by more than 5 %: it isn't shipped")
    folders = [path for path in sorted((result / "generators" / name).glob("*")) if (path / f"{path.name}.toml").is_file()]
    if len(folders) != 1:
        raise VisitError(f"{result}: {name} is not exported: `gpu-train run export` does it, where the pairs are")
    return folders[0]


def keep(root, result, names):
    """Copies the generators NAMES into assets/generators, makes the figure `trained` of the report, and writes the tables."""
    try:
        report = json.loads((result / "report.json").read_text())
        rows = [{"data": data, "name": name, **figures} for data, judged in report["judged"].items() for name, figures in judged.items()]
        plans = [
            {"name": name, "pairs": of["plan"]["pairs"], "trainings": len(of["plan"]["trainings"]), "seconds": {part: float(of["seconds"][part]) for part in ("render", "train")}}
            for name, of in report["plans"].items()
            # A visit may end before a later plan is trained.
            if {"render", "train"} <= set(of["seconds"])
        ]
    except (OSError, ValueError, KeyError) as error:
        raise VisitError(f"{result}: no report of a run that judged: {error!r}", 2) from None
    if not plans or not rows:
        raise VisitError(f"{result}: no plan was rendered, trained and judged", 2)
    # All of them, before anything is written.
    sources = [chosen(result, report, name) for name in names]
    if len({source.name for source in sources}) < len(sources):
        raise VisitError(f"two of {', '.join(names)} are the same generator: name one of them", 2)
    for source in sources:
        target = root / "assets/generators" / source.name
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(source, target)
        print(target.relative_to(root))
    *gpus, processor, cores = report["machine"].rsplit(", ", 2)
    data = {
        "figure": "trained", "commit": report["packed"]["commit"], "date": report["date"],
        "machine": {"processor": ", ".join([*gpus, processor]), "cores": int(cores.split()[0])},
        "command": "gpu-train run", "plans": plans,
        **({"judged": report["judged_by"]} if "judged_by" in report else {}), "rows": rows,
    }  # fmt: skip
    tree = store.Tree(root)
    print(tree.save(data).relative_to(tree.root))
    print("\n".join(f"wrote {line}" for line in documents.render(tree)) or "all tables are as their data", file=sys.stdout)
