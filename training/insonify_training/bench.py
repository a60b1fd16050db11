"""Times models at the full field of view: ONNX Runtime, PyTorch and, if installed, OpenVINO, with equal weights.

`python -m insonify_training.bench --data DIR RUN...` times trained networks by their runs' folders;
`python -m insonify_training.bench MODEL.onnx...` times exported models, for which there is no PyTorch;
`python -m insonify_training.bench --network stride8 --channels 4` times an untrained network.
"""

import argparse
import statistics
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import torch

from .dataset import Dataset, DatasetError
from .export import ExportError, grid_of, load_run, place, session, write_onnx
from .networks import fold, make


def times_ms(run, runs):
    """Milliseconds of each of `runs` calls, after two warm-up calls."""
    times = []
    for i in range(runs + 2):
        begun = time.perf_counter()
        run()
        if i >= 2:
            times.append(1000 * (time.perf_counter() - begun))
    return times


def in_ort(path, x, threads):
    """Function that runs the model in ONNX Runtime."""
    ort = session(path, threads)
    return lambda: ort.run(None, {"input": x})


def in_openvino(path, x, threads):
    """Function that runs the model in OpenVINO; None if that isn't installed."""
    try:
        import openvino
    except ImportError:
        return None
    core = openvino.Core()
    options = {"INFERENCE_NUM_THREADS": threads, "INFERENCE_PRECISION_HINT": "f32", "PERFORMANCE_HINT": "LATENCY"}
    model = core.read_model(str(path))
    model.reshape(list(x.shape))
    request = core.compile_model(model, "CPU", options).create_infer_request()
    return lambda: request.infer({0: x})


def in_torch(network, x, threads):
    """Function that runs the network in PyTorch, channels_last."""
    torch.set_num_threads(threads)
    network = network.to(memory_format=torch.channels_last)
    tensor = torch.from_numpy(x).to(memory_format=torch.channels_last)

    def run():
        with torch.inference_mode():
            network(tensor)

    return run


def main(argv=None):
    """Entry point of the command."""
    p = argparse.ArgumentParser(prog="insonify-generator-bench", description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    p.add_argument("models", nargs="*", type=Path, help="folders of runs, and exported models with their manifests beside them")
    p.add_argument("--data", type=Path, help="data set that the runs were trained on")
    p.add_argument("--network", action="append", default=[], help="time this network untrained; may be given again")
    p.add_argument("--channels", type=int, default=4, help="input channels of --network [default: 4]")
    p.add_argument("--size", default="1386x1000", help="field of view, px; of exported models in beam coordinates scanlines x range cells [default: 1386x1000]")
    p.add_argument("--threads", type=int, default=2)
    p.add_argument("--runs", type=int, default=20)
    p.add_argument("--skip-torch", action="store_true")
    args = p.parse_args(argv)
    runs = [path for path in args.models if path.is_dir()]
    for path in args.models:
        if not (path.is_dir() or path.is_file() and path.with_suffix(".toml").is_file()):
            raise SystemExit(f"{path}: no run's folder, and no model with its manifest beside it")
    if runs and args.data is None:
        raise SystemExit("--data is missing: a run's channels are those of its data set")
    size = tuple(map(int, args.size.split("x")))
    random = np.random.default_rng(1)
    print(f"{'model':24} {'input':>16} {'runtime':12} {'min ms':>8} {'median ms':>10}")

    def line(name, x, runtime, run):
        if run is not None:
            times = times_ms(run, args.runs)
            shape = "x".join(map(str, x.shape[1:]))
            print(f"{name:24} {shape:>16} {runtime:12} {min(times):8.1f} {statistics.median(times):10.1f}", flush=True)

    with tempfile.TemporaryDirectory() as folder:

        def compare(name, network, channels, size):
            path = Path(folder) / f"{name}.onnx"
            write_onnx(network, channels, path)
            x = random.random((1, channels, *place(size[::-1], network.padding_multiple)[0]), dtype=np.float32)
            line(name, x, "onnxruntime", in_ort(path, x, args.threads))
            line(name, x, "openvino", in_openvino(path, x, args.threads))
            if not args.skip_torch:
                line(name, x, "pytorch", in_torch(network, x, args.threads))

        for name in args.network:
            torch.manual_seed(1)
            compare(name, fold(make(name, args.channels)), args.channels, size)
        try:
            for run in runs:
                data = Dataset(args.data, grid_of(run))
                trainer, _ = load_run(run, data)
                compare(run.name, fold(trainer.generator), trainer.encode.channels, data.split("train")[0].size if data.grid else size)
        except (ExportError, DatasetError) as error:
            raise SystemExit(str(error)) from None
        for path in (path for path in args.models if path not in runs):
            import tomllib

            manifest = tomllib.loads(path.with_suffix(".toml").read_text(encoding="utf-8"))
            channels = session(path).get_inputs()[0].shape[1]
            x = random.random((1, channels, *place(size[::-1], manifest["padding_multiple"])[0]), dtype=np.float32)
            line(path.stem, x, "onnxruntime", in_ort(path, x, args.threads))
            line(path.stem, x, "openvino", in_openvino(path, x, args.threads))
    return 0


if __name__ == "__main__":
    sys.exit(main())
