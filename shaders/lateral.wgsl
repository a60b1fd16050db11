// Lateral point-spread function: each sample becomes the beam's weighted sum over neighbouring scanlines.
// Each block of DEPTH_BLOCK samples has a kernel, or the profile of its scanline's beam; weights beyond the array are made
// up for: with the aperture in power, by a factor of two at most, else in amplitude. Complex [scanlines × row_samples] in and out, two samples per vector. A thread makes four samples of a
// scanline. Each scanline sees its neighbours' scatterers with the gain of its own aperture. The wavefront of a steered
// look is across its scanlines: a neighbour's samples lie deeper or higher.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> kernels: array<f32>;
@group(0) @binding(2) var<storage, read> baseband: array<vec2<f32>>;
@group(0) @binding(3) var<storage, read_write> focused: array<vec2<f32>>;
// Gain of each block as amplitude, and its place among the planes [scanlines × blocks]. Read if APERTURE, as the rest.
@group(0) @binding(4) var<storage, read> block_gains: array<vec2<f32>>;
@group(0) @binding(5) var<uniform> aperture: Aperture;
@group(0) @binding(6) var<storage, read> profiles: array<f32>;
@group(0) @binding(7) var<storage, read> blends: array<f32>;

override APERTURE: bool;
override STEERED: bool = false;

// Weight of a tap in the profile of a plane; zero beyond its ends.
fn profile_at(profile: u32, tap: u32) -> f32 {
    let inside = f32(tap) >= blends[3u * profile + 1u] && f32(tap) < blends[3u * profile + 2u];
    return select(0.0, profiles[profile * (2u * params.lateral_half + 1u) + tap], inside);
}

// A neighbour's sample; nothing beyond the row.
fn sample_of(line: u32, sample: i32) -> vec2<f32> {
    let there = sample >= 0 && sample < i32(params.row_samples);
    let at = line * params.row_samples + u32(clamp(sample, 0, i32(params.row_samples) - 1));
    return select(vec2<f32>(0.0), baseband[at], there);
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let line = id.y;
    let first = id.x * 4u;
    if first >= params.row_samples {
        return;
    }
    let half = i32(params.lateral_half);
    let taps = 2u * params.lateral_half + 1u;
    let blocks = params.row_samples >> BLOCK_SHIFT;
    let block = first >> BLOCK_SHIFT;
    var kept = 1.0;
    var part = 0.0;
    var near = 0u;
    var far = 0u;
    var own = 1.0;
    if APERTURE {
        let gain = block_gains[line * blocks + block];
        own = gain.x;
        let place = clamp(gain.y, 0.0, f32(aperture.planes - 1u));
        let low = min(u32(place), max(aperture.planes, 2u) - 2u);
        part = place - f32(low);
        near = low * params.scanlines + line;
        far = min(low + 1u, aperture.planes - 1u) * params.scanlines + line;
        kept = (1.0 - part) * blends[3u * near] + part * blends[3u * far];
    }
    var power = 0.0;
    var total = 0.0;
    var kernel_power = 0.0;
    var a = vec2<f32>(0.0);
    var b = vec2<f32>(0.0);
    var c = vec2<f32>(0.0);
    var d = vec2<f32>(0.0);
    for (var tap = -half; tap <= half; tap++) {
        let at = u32(tap + half);
        let kernel = kernels[block * taps + at];
        kernel_power += kernel * kernel;
        let source = i32(line) + tap;
        if source < 0 || source >= i32(params.scanlines) {
            continue;
        }
        var weight = kernel;
        if kept < 1.0 {
            weight = kept * kernel + ((1.0 - part) * profile_at(near, at) + part * profile_at(far, at));
        }
        if weight <= 0.0 {
            continue;
        }
        power += weight * weight;
        total += weight;
        let other = u32(source);
        if APERTURE {
            weight *= min(own / block_gains[other * blocks + block].x, NEIGHBOUR_GAIN_MAX);
        }
        if STEERED {
            let later_mm = f32(tap) * params.steer_shift_mm;
            let before = i32(first) - i32(floor(later_mm / params.sample_spacing_mm + 0.5));
            let turn = weight * phasor(-params.phase_turns_per_mm * later_mm);
            a += times(sample_of(other, before), turn);
            b += times(sample_of(other, before + 1), turn);
            c += times(sample_of(other, before + 2), turn);
            d += times(sample_of(other, before + 3), turn);
        } else {
            let from_sample = other * params.row_samples + first;
            a += weight * baseband[from_sample];
            b += weight * baseband[from_sample + 1u];
            c += weight * baseband[from_sample + 2u];
            d += weight * baseband[from_sample + 3u];
        }
    }
    let scale = select(1.0 / max(total, 1.0e-30), sqrt(kernel_power / max(power, 0.5 * kernel_power)), APERTURE);
    let out = line * params.row_samples + first;
    focused[out] = a * scale;
    focused[out + 1u] = b * scale;
    focused[out + 2u] = c * scale;
    focused[out + 3u] = d * scale;
}
