// Lateral point-spread function: each sample becomes the beam's weighted sum over neighbouring scanlines.
// In and out: complex [scanlines × row_samples], two samples per vector. A thread makes four samples of a scanline.
//
// Each block of DEPTH_BLOCK samples has a kernel, or the profile of its scanline's beam. Kernels of a phased array are
// wider off its normal. A kernel may reach beyond the array. With an aperture, it meets the mirror image of what is
// within, a quarter of a cycle later. Without one, the weights within are scaled to the sum of all.
//
// Each scanline sees its neighbours' scatterers with the gain of its own aperture. It receives their echoes of
// reflected paths with the kernel's weight, times reflected power over the greater of reflected and aperture power.
// The greater of this weight and the weight by the gain applies.
//
// The wavefront of a steered frame is across its scanlines, so a neighbour's samples lie deeper or higher.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> kernels: array<f32>;
@group(0) @binding(2) var<storage, read> baseband: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> focused: array<vec4<f32>>;
// Gain of each block (as an amplitude), and its position among the depth planes [scanlines × blocks]. This buffer and
// the next three are read if APERTURE.
@group(0) @binding(4) var<storage, read> block_gains: array<vec2<f32>>;
@group(0) @binding(5) var<uniform> aperture: Aperture;
@group(0) @binding(6) var<storage, read> profiles: array<f32>;
@group(0) @binding(7) var<storage, read> blends: array<f32>;
// For each block's kernel: half width in scanlines, and sum of the squared weights.
@group(0) @binding(8) var<storage, read> kernel_spans: array<vec2<f32>>;
// Ratio of the amplitude that came by reflections to the amplitude that the aperture sees [scanlines × blocks]. Read if
// APERTURE.
@group(0) @binding(9) var<storage, read> reflected: array<f32>;

const THREADS: u32 = 64u;
// Threads per block of samples, and blocks per workgroup.
const SHARING: u32 = DEPTH_BLOCK / 4u;
const BLOCKS: u32 = THREADS / SHARING;
const TAPS_MAX: u32 = 2u * LATERAL_HALF_MAX + 1u;

// Weight of each tap; after `receive` with gains and reflected echoes [taps × blocks].
var<workgroup> weights: array<f32, TAPS_MAX * BLOCKS>;
// Phase of each neighbour's wavefront; used only in steered frames.
var<workgroup> turns: array<vec2<f32>, TAPS_MAX>;
// Over each thread's taps: sum of the squared weights and sum of the weights, then both sums of the plain kernel.
var<workgroup> sums: array<vec4<f32>, THREADS>;
// First tap with a weight, and one after the last, of each thread.
var<workgroup> ends: array<vec2<u32>, THREADS>;

override APERTURE: bool;
override STEERED: bool = false;

// Weight of a tap in a profile; zero beyond the profile's ends.
fn profile_at(profile: u32, tap: u32) -> f32 {
    let inside = f32(tap) >= blends[3u * profile + 1u] && f32(tap) < blends[3u * profile + 2u];
    return select(0.0, profiles[profile * (2u * params.lateral_half + 1u) + tap], inside);
}

// First tap of a profile; the middle of the kernel if the profile is empty.
fn start_of(profile: u32) -> f32 {
    return select(f32(params.lateral_half), blends[3u * profile + 1u], blends[3u * profile + 2u] > 0.0);
}

// A neighbour's sample; 0 beyond the ends of the row.
fn sample_of(line: u32, sample: i32) -> vec2<f32> {
    let there = sample >= 0 && sample < i32(params.row_samples);
    let at = line * params.row_samples + u32(clamp(sample, 0, i32(params.row_samples) - 1));
    let pair = baseband[at >> 1u];
    return select(vec2<f32>(0.0), select(pair.xy, pair.zw, (at & 1u) == 1u), there);
}

// Scanline at a position; beyond the array's ends, its mirror image. No kernel is wider than the array.
fn mirrored(position: i32) -> u32 {
    let lines = i32(params.scanlines);
    return u32(select(max(position, -1 - position), 2 * lines - 1 - position, position >= lines));
}

// Two complex samples, multiplied by i if they are beyond the array.
fn quarter_later(pair: vec4<f32>, beyond: bool) -> vec4<f32> {
    return select(pair, vec4<f32>(-pair.y, pair.x, -pair.w, pair.z), beyond);
}

// Fraction of a phased array's aperture, projected on a scanline: the cosine of the scanline's angle to the normal. 1
// for other arrays.
fn projection_of(line: u32) -> f32 {
    let turns = params.line_turns * (f32(line) + 0.5 - 0.5 * f32(params.scanlines));
    return select(max(phasor(turns).x, PROJECTION_MIN), 1.0, params.line_turns == 0.0);
}

// Weight of tap `at` in a block's kernel, widened by one over `projection`.
fn kernel_at(block: u32, at: u32, projection: f32) -> f32 {
    let kernel = block * (2u * params.lateral_half + 1u) + params.lateral_half;
    let offset = u32(abs(i32(at) - i32(params.lateral_half)));
    if projection == 1.0 || offset == 0u {
        return kernels[kernel + offset];
    }
    let position = f32(offset) * projection;
    let low = min(u32(position), params.lateral_half - 1u);
    return mix(kernels[kernel + low], kernels[kernel + low + 1u], position - f32(low));
}

// Amplitude of a block that came by reflections, at most 1; `gain` is the scanline's aperture gain.
fn reflected_of(line: u32, block: u32, gain: f32) -> f32 {
    return min(gain * reflected[line * (params.row_samples >> BLOCK_SHIFT) + block], 1.0);
}

// Computes the weights of a block. Each of the SHARING threads of the block computes every SHARING-th tap.
fn weigh(thread: u32, line: u32, block: u32) {
    let half = i32(params.lateral_half);
    let taps = 2u * params.lateral_half + 1u;
    let blocks = params.row_samples >> BLOCK_SHIFT;
    var kept = 1.0;
    var part = 0.0;
    var near = 0u;
    var far = 0u;
    let projection = projection_of(line);
    var reach = u32(kernel_spans[block].x);
    if projection < 1.0 {
        reach = min(u32(ceil(f32(reach + 1u) / projection)), params.lateral_half);
    }
    var begin = params.lateral_half - reach;
    var limit = params.lateral_half + reach + 1u;
    if APERTURE {
        let gain = block_gains[line * blocks + block];
        let position = clamp(gain.y, 0.0, f32(aperture.planes - 1u));
        let low = min(u32(position), max(aperture.planes, 2u) - 2u);
        part = position - f32(low);
        near = low * params.scanlines + line;
        far = min(low + 1u, aperture.planes - 1u) * params.scanlines + line;
        kept = (1.0 - part) * blends[3u * near] + part * blends[3u * far];
        if kept < 1.0 {
            begin = min(begin, u32(min(start_of(near), start_of(far))));
            limit = max(limit, u32(max(blends[3u * near + 2u], blends[3u * far + 2u])));
        }
    }
    var sum = vec4<f32>(0.0);
    var first = taps;
    var end = 0u;
    for (var at = begin + thread % SHARING; at < limit; at += SHARING) {
        let kernel = kernel_at(block, at, projection);
        let position = i32(line) + i32(at) - half;
        let source = mirrored(position);
        let there = APERTURE || i32(source) == position;
        var weight = select(0.0, kernel, there);
        if kept < 1.0 && there {
            weight = kept * kernel + ((1.0 - part) * profile_at(near, at) + part * profile_at(far, at));
        }
        sum += vec4<f32>(weight * weight, weight, kernel * kernel, kernel);
        if weight > 0.0 || (APERTURE && kernel > 0.0) {
            first = min(first, at);
            end = at + 1u;
        }
        weights[at * BLOCKS + thread / SHARING] = weight;
    }
    sums[thread] = sum;
    ends[thread] = vec2<u32>(first, end);
}

// Applies gains and reflected echoes to the weights that a thread computed. Reflected echoes keep the power of the
// kernel: `of_kernel` is their scale over that of the other echoes.
fn receive(thread: u32, line: u32, block: u32, of_kernel: f32) {
    let blocks = params.row_samples >> BLOCK_SHIFT;
    let own = block_gains[line * blocks + block].x;
    let projection = projection_of(line);
    for (var at = ends[thread].x; at < ends[thread].y; at += SHARING) {
        let source = mirrored(i32(line) + i32(at) - i32(params.lateral_half));
        let gain = block_gains[source * blocks + block].x;
        let by_reflections = reflected_of(source, block, gain);
        let carried = max(gain, by_reflections);
        let ratio = (by_reflections / carried) * (by_reflections / carried);
        let slot = at * BLOCKS + thread / SHARING;
        let by_gain = weights[slot] * min(own / carried, NEIGHBOUR_GAIN_MAX);
        weights[slot] = max(by_gain, kernel_at(block, at, projection) * of_kernel * ratio);
    }
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let thread = local.x;
    let line = id.y;
    let first = id.x * 4u;
    let half = i32(params.lateral_half);
    let block = first >> BLOCK_SHIFT;
    let inside = first < params.row_samples;
    if inside {
        weigh(thread, line, block);
    }
    if STEERED {
        for (var at = thread; at < 2u * params.lateral_half + 1u; at += THREADS) {
            turns[at] = phasor(-params.phase_turns_per_mm * (f32(i32(at) - half) * params.steer_shift_mm));
        }
    }
    workgroupBarrier();
    var sum = vec4<f32>(0.0);
    var begin = TAPS_MAX;
    var to = 0u;
    for (var other = thread - thread % SHARING; other < thread - thread % SHARING + SHARING; other++) {
        sum += sums[other];
        begin = min(begin, ends[other].x);
        to = max(to, ends[other].y);
    }
    let power = sum.x;
    let total = sum.y;
    let kernel_power = kernel_spans[block].y;
    let width = select(sqrt(sum.z / kernel_power), 1.0, projection_of(line) == 1.0);
    // A widened kernel scaled to a sum of 1 would make speckle darker.
    let level = select(width / sum.w, 1.0, projection_of(line) == 1.0);
    let scale = select(1.0 / max(total * level, 1.0e-30), sqrt(kernel_power / max(power, 0.5 * kernel_power)), APERTURE);
    if APERTURE {
        if inside {
            receive(thread, line, block, 1.0 / (scale * width));
        }
        workgroupBarrier();
    }
    if !inside {
        return;
    }
    var a = vec4<f32>(0.0);
    var b = vec4<f32>(0.0);
    for (var at = begin; at < to; at++) {
        let tap = i32(at) - half;
        let other = mirrored(i32(line) + tap);
        let weight = weights[at * BLOCKS + thread / SHARING];
        let beyond = i32(other) != i32(line) + tap;
        if STEERED {
            let later_mm = f32(tap) * params.steer_shift_mm;
            let before = i32(first) - i32(floor(later_mm / params.sample_spacing_mm + 0.5));
            let turn = weight * select(turns[at], vec2<f32>(-turns[at].y, turns[at].x), beyond);
            a += vec4<f32>(times(sample_of(other, before), turn), times(sample_of(other, before + 1), turn));
            b += vec4<f32>(times(sample_of(other, before + 2), turn), times(sample_of(other, before + 3), turn));
        } else {
            let pair = (other * params.row_samples + first) >> 1u;
            a += weight * quarter_later(baseband[pair], beyond);
            b += weight * quarter_later(baseband[pair + 1u], beyond);
        }
    }
    let out = (line * params.row_samples + first) >> 1u;
    focused[out] = a * scale;
    focused[out + 1u] = b * scale;
}
