// Adds multiples to the focused lines: echoes that the face reflects back into the body, and that return again. A
// workgroup takes a scanline. In and out: complex [scanlines × row_samples].

@group(0) @binding(0) var<uniform> params: Params;
// The lines with multiples, plus their weak echoes: what strong echoes return again.
@group(0) @binding(1) var<storage, read_write> again: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read_write> focused: array<vec2<f32>>;

// Factor of the amplitude that the face reflects.
const REFLECTED: f32 = 1.0;

// Threads that share the strong samples of one sample, and threads of a workgroup.
const SHARES: u32 = 4u;
const THREADS: u32 = SHARES * MULTIPLE_FIRST;

// Number of samples above a power, and numbers of strong samples of each thread.
var<workgroup> above: atomic<u32>;
var<workgroup> strong_of: array<u32, THREADS>;
// What each thread's strong samples return.
var<workgroup> returned: array<vec2<f32>, THREADS>;
// The strong samples in their order, with the part of the amplitude that returns again.
var<workgroup> strong_at: array<u32, MULTIPLE_SAMPLES>;
var<workgroup> strong: array<vec2<f32>, MULTIPLE_SAMPLES>;

fn power_of(echo: vec2<f32>) -> f32 {
    return echo.x * echo.x + echo.y * echo.y;
}

// The part of an echo that returns again. It falls to zero at the power `weakest`, so that a sample that is no longer
// strong leaves no step.
fn strong_part(echo: vec2<f32>, weakest: u32) -> vec2<f32> {
    let power = power_of(echo);
    return select(vec2<f32>(), echo * (1.0 - bitcast<f32>(weakest) / power), bitcast<u32>(power) > weakest);
}

@compute @workgroup_size(THREADS)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let row = group.x * params.row_samples;
    let thread = local.x;
    // The largest power that more than MULTIPLE_SAMPLES samples reach, bit by bit. Powers are positive, so their bits are
    // in the same order.
    var weakest = 0u;
    for (var bit = 1u << 30u; bit > 0u; bit >>= 1u) {
        if thread == 0u {
            atomicStore(&above, 0u);
        }
        workgroupBarrier();
        var count = 0u;
        for (var i = MULTIPLE_FIRST + thread; i < params.samples; i += THREADS) {
            count += u32(bitcast<u32>(power_of(focused[row + i])) >= (weakest | bit));
        }
        atomicAdd(&above, count);
        workgroupBarrier();
        if atomicLoad(&above) > MULTIPLE_SAMPLES {
            weakest |= bit;
        }
        workgroupBarrier();
    }
    // Strong samples in their order. Each thread looks through neighbouring samples.
    let length = (params.samples + THREADS - 1u) / THREADS;
    let from_sample = max(thread * length, MULTIPLE_FIRST);
    let to_sample = min((thread + 1u) * length, params.samples);
    var count = 0u;
    for (var i = from_sample; i < to_sample; i++) {
        count += u32(bitcast<u32>(power_of(focused[row + i])) > weakest);
    }
    strong_of[thread] = count;
    workgroupBarrier();
    var place = 0u;
    var total = 0u;
    for (var other = 0u; other < THREADS; other++) {
        place += select(0u, strong_of[other], other < thread);
        total += strong_of[other];
    }
    for (var i = from_sample; i < to_sample; i++) {
        let echo = focused[row + i];
        if bitcast<u32>(power_of(echo)) > weakest && place < MULTIPLE_SAMPLES {
            strong_at[place] = i;
            strong[place] = strong_part(echo, weakest);
            place++;
        }
    }
    workgroupBarrier();
    total = min(total, MULTIPLE_SAMPLES);
    var sum = 0.0;
    for (var j = 0u; j < total; j++) {
        sum += sqrt(power_of(strong[j]));
    }
    let reflection = REFLECTED * select(params.face_reflection, MULTIPLE_GAIN_MAX / sum, params.face_reflection * sum > MULTIPLE_GAIN_MAX);
    // No echo nearer than MULTIPLE_FIRST samples returns again, so that many samples depend on earlier ones alone.
    for (var first = 0u; first < params.samples; first += MULTIPLE_FIRST) {
        let i = first + thread % MULTIPLE_FIRST;
        var part = vec2<f32>();
        if i < params.samples {
            for (var j = thread / MULTIPLE_FIRST; j < total && strong_at[j] < i; j += SHARES) {
                // Sample i lies i + 1/2 samples deep, so depths of the samples j and k add up to that of sample j + k + 1.
                let b = again[row + i - 1u - strong_at[j]];
                let a = strong[j];
                part += vec2<f32>(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
            }
        }
        returned[thread] = part;
        workgroupBarrier();
        if thread < MULTIPLE_FIRST && i < params.samples {
            let echo = focused[row + i];
            var added = vec2<f32>();
            for (var share = 0u; share < SHARES; share++) {
                added += returned[share * MULTIPLE_FIRST + thread];
            }
            let whole = echo + reflection * added;
            let weak = select(echo - strong_part(echo, weakest), echo, i < MULTIPLE_FIRST);
            focused[row + i] = whole;
            again[row + i] = whole + weak;
        }
        storageBarrier();
        workgroupBarrier();
    }
}
