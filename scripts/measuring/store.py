"""Data files of figures, kept steps of an unfinished measuring, and what a figure says of its origin."""

import datetime
import hashlib
import json
import os
import pathlib
import re
import shutil
import subprocess

# A figure is old if one of these has changed since.
CODE = ["src", "crates", "assets", "configs", "Cargo.lock"]
# What a measuring depends on.
INPUTS = [*CODE, "Cargo.toml", "scripts/soak", "scripts/live-error", "scripts/measuring"]


class FigureError(Exception):
    """A message for the user, and the exit code."""

    def __init__(self, message, code=1):
        super().__init__(message)
        self.code = code


class Tree:
    """A checkout: its data files, documents and working folder."""

    def __init__(self, root):
        self.root = pathlib.Path(root).resolve()
        self.data = self.root / "docs/figures"
        self.work = self.root / "out/figures"

    def names(self):
        """Names of the data files."""
        return sorted(path.stem for path in self.data.glob("*.json"))

    def load(self, name):
        """Data of a figure; None if it was never measured."""
        path = self.data / f"{name}.json"
        try:
            data = json.loads(path.read_text())
        except FileNotFoundError:
            return None
        except ValueError as error:
            raise FigureError(f"{path} is no JSON: {error}") from None
        missing = [key for key in ("figure", "commit", "date", "machine", "command", "rows") if key not in data]
        if missing:
            raise FigureError(f"{path} lacks {', '.join(missing)}")
        if data["figure"] != name:
            raise FigureError(f"{path} holds the figure {data['figure']!r}: its name must be the file's")
        return data

    def save(self, data):
        """Writes a figure's data; returns the path."""
        path = self.data / f"{data['figure']}.json"
        replace(path, text(data))
        return path

    def git(self, *arguments):
        """Output of git; raises `FigureError` if it fails."""
        done = subprocess.run(["git", *arguments], cwd=self.root, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise FigureError(f"git {' '.join(arguments)}: {done.stderr.strip()}")
        return done.stdout.strip()

    def commit(self):
        """The commit that is checked out; refuses uncommitted changes of what a measuring depends on."""
        there = [path for path in INPUTS if (self.root / path).exists()]
        changed = self.git("status", "--porcelain", "--", *there)
        if changed:
            raise FigureError("commit these first, so that the figure's commit is what was measured:\n" + changed, 2)
        return self.git("rev-parse", "--short=7", "HEAD")

    def inputs(self):
        """The last commit that changed what a measuring depends on."""
        return self.git("rev-list", "-1", "HEAD", "--", *INPUTS)

    def commits_since(self, commit):
        """Number of commits since that changed code; None if this clone lacks the commit."""
        try:
            there = [path for path in CODE if (self.root / path).exists()]
            return int(self.git("rev-list", "--count", f"{commit}..HEAD", "--", *there))
        except FigureError:
            return None


class Kept:
    """Finished steps of a figure that is being measured. They count for one build and one command each."""

    def __init__(self, tree, name, build):
        self.folder = tree.work / name
        self.path = self.folder / "steps.json"
        self.build = build
        self.steps = None
        try:
            found = json.loads(self.path.read_text())
            if found["build"] == build:
                self.steps = found["steps"]
        except (FileNotFoundError, ValueError, KeyError):
            pass
        if self.steps is None:
            # What an earlier build left could be taken for this one's.
            shutil.rmtree(self.folder, ignore_errors=True)
            self.steps = {}
            self.write()

    def get(self, step, command):
        """What the step measured, if it was the same command."""
        found = self.steps.get(step)
        return found if found and found["command"] == command else None

    def add(self, step, command, values):
        """Keeps a step."""
        self.steps[step] = {"command": command, "values": values}
        self.write()

    def write(self):
        replace(self.path, json.dumps({"build": self.build, "steps": self.steps}))

    def remove(self):
        """Forgets all steps."""
        self.path.unlink(missing_ok=True)


def kept_count(tree, name):
    """Number of steps of an unfinished measuring."""
    try:
        return len(json.loads((tree.work / name / "steps.json").read_text())["steps"])
    except (FileNotFoundError, ValueError, KeyError):
        return 0


def replace(path, content):
    """Writes a file whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_name(f".{path.name}.new")
    new.write_text(content)
    os.replace(new, path)


def text(data):
    """JSON with a line for each row, step and other entry."""
    lines = []
    for key, value in data.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            items = ",\n".join(f"  {json.dumps(item, ensure_ascii=False)}" for item in value)
            lines.append(f"{json.dumps(key)}: [\n{items}\n]")
        else:
            lines.append(f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def today():
    """Date in UTC."""
    return datetime.datetime.now(datetime.timezone.utc).date().isoformat()


def machine(cpuinfo=pathlib.Path("/proc/cpuinfo")):
    """Model of the processor, and the cores that this process may use."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    try:
        info = cpuinfo.read_text()
    except OSError:
        return {"processor": "unknown processor", "cores": cores}
    found = re.search(r"(?m)^model name\s*:\s*(.+)$", info)
    model = re.sub(r"\((R|TM)\)| Processor\b| CPU\b", "", found[1]).strip() if found else "unknown processor"
    flags = re.search(r"(?m)^flags\s*:\s*(.+)$", info)
    words = set(flags[1].split()) if flags else set()
    widest = next((name for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in words), None)
    return {"processor": f"{model} ({widest})" if widest else model, "cores": cores}


def sha256(path):
    """SHA-256 of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
