"""Embree on the rays that scripts/embree-bench wrote: one process a core, each with its own copy of the scene.

A ray of insonify goes on to where the medium changes, through surfaces that a higher one hides. Embree finds the nearest
triangle; a ray that is not at its end yet is cast again from there, as insonify does. Only the casts are timed. The trace pass
does more: membership of nested surfaces, refraction, echoes, attenuation.
"""
import json, multiprocessing, os, sys, time
import numpy as np
from embreex import mesh_construction, rtcore, rtcore_scene

folder = sys.argv[1]
load = lambda name: np.load(os.path.join(folder, name + ".npy"))
BEYOND_MM = 0.02  # past a ray's end, so that a miss is no hit there
STEP_MM = 1e-3  # from a hit to the next cast; crossings that near are one place


def cast(scene, origins, directions, lengths):
    """Seconds in Embree, casts, and rays that found a triangle where they end."""
    seconds = casts = ended = 0
    while len(lengths):
        start = time.perf_counter()
        far = scene.run(origins, directions, dists=lengths + BEYOND_MM, query="DISTANCE")
        seconds += time.perf_counter() - start
        casts += len(lengths)
        ended += np.count_nonzero(np.abs(far - lengths) < 0.01)
        on = far < lengths - 0.01
        gone = (far + STEP_MM)[on]
        origins, directions, lengths = origins[on] + directions[on] * gone[:, None], directions[on], lengths[on] - gone
        if casts > 1e9:
            sys.exit("a ray does not end")
    return seconds, casts, ended


def work(part, parts, barrier, results):
    scene = rtcore_scene.EmbreeScene(rtcore.EmbreeDevice())
    mesh = mesh_construction.TriangleMesh(scene, load("vertices"), load("faces").astype(np.int32))  # noqa: F841, kept alive
    # Blocks, as they come: neighbours are alike, which both profit from.
    origins, directions, lengths = (np.array_split(load(n), parts)[part].copy() for n in ("origins", "directions", "lengths"))
    lengths = lengths[:, 0] - STEP_MM
    origins += directions * STEP_MM
    cast(scene, origins[:1000], directions[:1000], lengths[:1000])
    for _ in range(5):
        barrier.wait()
        results.put(cast(scene, origins, directions, lengths))


if __name__ == "__main__":
    about = json.load(open(os.path.join(folder, "frames.json")))
    cores = len(os.sched_getaffinity(0))
    barrier, results = multiprocessing.Barrier(cores), multiprocessing.Queue()
    workers = [multiprocessing.Process(target=work, args=(i, cores, barrier, results)) for i in range(cores)]
    for worker in workers:
        worker.start()
    found = sorted(results.get() for _ in range(5 * cores))
    for worker in workers:
        worker.join()
    rays, frames = len(load("lengths")), about["frames"]
    casts = sum(f[1] for f in found) / 5
    ended = sum(f[2] for f in found) / 5 / rays
    embree_ms = 1e3 * found[len(found) // 2][0] / frames
    ours_ms = sum(about["trace_ms"]) / frames
    print(f"{about['triangles']} triangles, {rays // frames} rays a frame, {casts / frames:.0f} casts, {cores} cores")
    print(f"{100 * ended:.1f} % of the rays find a triangle where insonify ended them; the others end at the image's depth")
    print("| | ms a frame | million casts/s |")
    print("|---|---|---|")
    print(f"| insonify's trace, {about['device']} ({about['driver']}) | {ours_ms:.0f} | {casts / frames / ours_ms / 1e3:.2f} |")
    print(f"| Embree 4.4, {cores} processes | {embree_ms:.0f} | {casts / frames / embree_ms / 1e3:.2f} |")
    print(f"insonify takes {ours_ms / embree_ms:.2f} times Embree's time")
