"""Measuring of a figure: its steps one after the other, each kept when it is done."""

import contextlib
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import threading
import time

from . import store
from .store import FigureError, Kept

# Longest measuring of a figure, s. What was finished is kept, so the same command goes on.
LIMIT_S = 600


def measure(tree, figure, program, commit, limit_s=LIMIT_S):
    """Measures a figure of the program built from `commit`, and writes its data. Steps of an interrupted measuring of the same
    build on the same machine are taken over."""
    program = pathlib.Path(program).resolve()
    if tree.commit() != commit:
        raise FigureError(f"the checkout moved away from {commit} since the program was built", 2)
    build = {"inputs": tree.inputs(), "program": store.sha256(program), "machine": store.machine()}
    kept = Kept(tree, figure.name, build)
    until = time.monotonic() + limit_s
    steps = figure.steps(tree, program, kept.folder)
    for number, step in enumerate(steps, 1):
        command = [shown(part, tree, program) for part in step.command]
        say = f"{figure.name}: step {number} of {len(steps)}, {step.name}"
        if kept.get(step.name, command):
            print(f"{say}: kept", file=sys.stderr)
            continue
        print(f"{say}: {' '.join(command)}", file=sys.stderr)
        folder = kept.folder / step.name
        folder.mkdir(parents=True, exist_ok=True)
        left_s = until - time.monotonic()
        code, peak_kib = run(step.command, tree.root, folder, left_s)
        if code is None:
            raise FigureError(f"{figure.name}: not finished within {limit_s:.0f} s; the same command goes on at step {number}")
        tail = (folder / "stderr.txt").read_text(errors="replace")[-2000:].strip()
        if code not in step.codes:
            raise FigureError(f"{figure.name}, {step.name}: exit code {code}; {folder}/stderr.txt ends with:\n{tail}")
        try:
            values = step.collect(folder, peak_kib)
        except (OSError, ValueError, KeyError, IndexError, TypeError) as error:
            raise FigureError(f"{figure.name}, {step.name}: no figures in {folder}: {error!r}\n{tail}") from None
        kept.add(step.name, command, values)
    done = [{"step": step.name, **kept.steps[step.name]} for step in steps]
    for entry in done:
        entry["command"] = " ".join(entry["command"])
    data = {
        "figure": figure.name,
        "commit": commit,
        "date": store.today(),
        "machine": store.machine(),
        "command": figure.command,
        **figure.summary(done),
        "steps": done,
    }
    for source, target in figure.files.items():
        copied = tree.root / target
        copied.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(kept.folder / source, copied)
    path = tree.save(data)
    kept.remove()
    return path


def interrupts():
    """Signals that end a measuring. SIGHUP is that of a closed terminal; `nohup` makes it ignored."""
    hang_up = [signal.SIGHUP] if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN else []
    return [signal.SIGINT, signal.SIGTERM, *hang_up]


def shown(part, tree, program):
    """A word of a command as it is kept: the program by its name, paths relative to the checkout."""
    return "insonify" if str(part) == str(program) else str(part).replace(f"{tree.root}/", "")


def run(command, cwd, folder, limit_s):
    """Runs a command. Returns its exit code, None where the limit ended it, and its peak of resident memory, KiB."""
    process, asked, late = None, [], threading.Event()

    def end(number):
        # What the command started belongs to its group.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, number)

    def interrupt(*_):
        # An exception here could lose the process while it is started. A second request ends what ignores the first.
        asked.append(True)
        if process:
            end(signal.SIGTERM if len(asked) == 1 else signal.SIGKILL)

    def time_over():
        late.set()
        end(signal.SIGKILL)

    before = {number: signal.signal(number, interrupt) for number in interrupts()}
    timer = threading.Timer(max(0.0, limit_s), time_over)
    timer.daemon = True
    try:
        with open(folder / "stdout.txt", "wb") as out, open(folder / "stderr.txt", "wb") as err:
            words = [str(part) for part in command]
            process = subprocess.Popen(words, cwd=cwd, stdin=subprocess.DEVNULL, stdout=out, stderr=err, start_new_session=True)
        if asked:
            end(signal.SIGTERM)
        timer.start()
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    except OSError as error:
        raise FigureError(f"{command[0]} cannot be run: {error}") from None
    finally:
        timer.cancel()
        for number, handler in before.items():
            signal.signal(number, handler)
    if asked:
        raise KeyboardInterrupt
    return (None if late.is_set() else process.returncode), usage.ru_maxrss
