"""Embree on the rays that scripts/embree-bench wrote: one process a core, each with its own copy of the scene.

A ray of insonify ends where the medium changes or at the image's depth; Embree looks for the nearest triangle along it. The
trace pass does that and all else: crossings of nested surfaces, refraction, echoes, attenuation.
"""
import json, multiprocessing, os, sys, time
import numpy as np
from embreex import mesh_construction, rtcore, rtcore_scene

folder = sys.argv[1]
load = lambda name: np.load(os.path.join(folder, name + ".npy"))


def work(part, parts, barrier, times):
    scene = rtcore_scene.EmbreeScene(rtcore.EmbreeDevice())
    mesh = mesh_construction.TriangleMesh(scene, load("vertices"), load("faces").astype(np.int32))  # noqa: F841, kept alive
    # Blocks, as they come: neighbours are alike, which both profit from.
    origins, directions, lengths = (np.array_split(load(n), parts)[part].copy() for n in ("origins", "directions", "lengths"))
    lengths = lengths[:, 0].copy()
    scene.run(origins[:1000], directions[:1000], dists=lengths[:1000])
    for _ in range(5):
        barrier.wait()
        start = time.perf_counter()
        scene.run(origins, directions, dists=lengths)
        times.put(time.perf_counter() - start)


if __name__ == "__main__":
    about = json.load(open(os.path.join(folder, "frames.json")))
    cores = os.cpu_count()
    barrier, times = multiprocessing.Barrier(cores), multiprocessing.Queue()
    workers = [multiprocessing.Process(target=work, args=(i, cores, barrier, times)) for i in range(cores)]
    for worker in workers:
        worker.start()
    taken = sorted(times.get() for _ in range(5 * cores))
    for worker in workers:
        worker.join()
    rays, frames = len(load("lengths")), about["frames"]
    embree_ms = 1e3 * taken[len(taken) // 2] / frames
    ours_ms = sum(about["trace_ms"]) / frames
    print(f"{about['triangles']} triangles, {rays // frames} rays a frame, {cores} cores")
    print("| | ms a frame | million rays/s |")
    print("|---|---|---|")
    print(f"| insonify's trace, {about['device']} ({about['driver']}) | {ours_ms:.0f} | {rays / frames / ours_ms / 1e3:.2f} |")
    print(f"| Embree 4.4, {cores} processes | {embree_ms:.0f} | {rays / frames / embree_ms / 1e3:.2f} |")
    print(f"insonify takes {ours_ms / embree_ms:.2f} times Embree's time")
