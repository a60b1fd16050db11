// Echoes of a scanline by one workgroup. In each turn, every thread computes one echo, then adds the turn's echoes that
// fall on its own samples.

const THREADS: u32 = 64u;

// For each path of a group: running sum of echoes up to and including its own, and range of its first reflection.
var<workgroup> ends: array<u32, THREADS>;
var<workgroup> reflections_mm: array<f32, THREADS>;
// For each echo of a turn: its first sample, its value, and the weights of its samples.
var<workgroup> samples: array<i32, THREADS>;
var<workgroup> values: array<vec2<f32>, THREADS>;
var<workgroup> weights: array<vec4<f32>, THREADS>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    if group.x >= params.line_count {
        return;
    }
    let line = params.line_first + group.x;
    let weight = 1.0 / f32(params.rays * params.layers);
    let paths = params.rays * params.layer_count;
    for (var first = 0u; first < paths; first += THREADS) {
        // First the echoes of the path. If it reflects, then those of the axial path beyond that range, in place of
        // what the path missed.
        var count = 0u;
        var reflected_mm = BEYOND_MM;
        if first + thread < paths {
            let path = path_of(line, first + thread);
            count = count_of(path);
            for (var i = 1u; i <= count; i++) {
                if has_reflected(path, i) {
                    reflected_mm = min(reflected_mm, starts[path * STARTS + i]);
                }
            }
            if APERTURE && params.axial_paths > 0u && reflected_mm < BEYOND_MM {
                count += count_of(axial_path_of(line));
            }
        }
        ends[thread] = count;
        reflections_mm[thread] = reflected_mm;
        workgroupBarrier();
        if thread == 0u {
            for (var i = 1u; i < THREADS; i++) {
                ends[i] += ends[i - 1u];
            }
        }
        let total = workgroupUniformLoad(&ends[THREADS - 1u]);
        for (var turn = 0u; turn < total; turn += THREADS) {
            samples[thread] = NO_SAMPLE;
            let index = turn + thread;
            if index < total {
                var slot = 0u;
                for (var half = THREADS / 2u; half > 0u; half >>= 1u) {
                    slot += select(0u, half, ends[slot + half - 1u] <= index);
                }
                let path = path_of(line, first + slot);
                let segment = 1u + index - select(ends[max(slot, 1u) - 1u], 0u, slot == 0u);
                let own = count_of(path);
                var echo = Echo(NO_SAMPLE, vec2<f32>(0.0), vec4<f32>(0.0));
                if segment <= own {
                    echo = echo_of(line, path, segment, 1.0);
                } else {
                    let axial_path = axial_path_of(line);
                    if starts[axial_path * STARTS + segment - own] > reflections_mm[slot] {
                        echo = echo_of(line, axial_path, segment - own, weight);
                    }
                }
                samples[thread] = echo.sample;
                values[thread] = echo.value;
                weights[thread] = echo.weights;
            }
            workgroupBarrier();
            for (var i = 0u; i < min(total - turn, THREADS); i++) {
                let first_sample = samples[i];
                // The one tap that falls on a sample of this thread.
                let tap = (i32(thread) - first_sample) & i32(THREADS - 1u);
                let sample = first_sample + tap;
                if first_sample != NO_SAMPLE && tap < taps() && in_row(sample) {
                    let echoed = weights[i][tap] * values[i];
                    baseband[line * params.row_samples + u32(sample)] += echoed;
                }
            }
            workgroupBarrier();
        }
    }
}
