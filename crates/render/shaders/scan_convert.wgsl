// From scanlines to pixels: B-mode and, with MAPS, segmentation and attenuation. A thread makes one word of four pixels
// in a row. Words outside the sector have no thread and stay zero.
// The attenuation leaves as its square root in 16 bits per pixel, which keeps more digits of dark levels.

@group(0) @binding(0) var<uniform> params: Params;
// For each word that overlaps the sector, the centres of its four pixels as fractions of the sector's width (lowest
// ACROSS_BITS bits) and depth; OUTSIDE beyond the sector.
@group(0) @binding(1) var<storage, read> pixels: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> polar: array<u32>;
@group(0) @binding(3) var<storage, read> raster: array<u32>;
@group(0) @binding(4) var<storage, read> percentile: array<f32>;
@group(0) @binding(5) var<uniform> tissues: array<Tissue, TISSUES_MAX>;
@group(0) @binding(6) var<storage, read_write> bmode: array<u32>;
@group(0) @binding(7) var<storage, read_write> segmentation: array<u32>;
@group(0) @binding(8) var<storage, read_write> attenuation: array<vec2<u32>>;
// Index in the image of each word that overlaps the sector.
@group(0) @binding(9) var<storage, read> words: array<u32>;

// Whether segmentation and attenuation are written in addition to the image.
override MAPS: bool = true;

const ACROSS_SCALE: f32 = 1.0 / f32((1u << ACROSS_BITS) - 2u);
const DEPTH_SCALE: f32 = 1.0 / f32((1u << (32u - ACROSS_BITS)) - 2u);

struct Pixel {
    grey: u32,
    tissue: u32,
    // Square root of the attenuation, in steps of 1 / ROOT_STEPS.
    root: u32,
}

// Σμ (one way) and tissue on a map ray at a depth.
struct Section {
    sum_np: f32,
    tissue: u32,
}

fn raster_sum(word: u32) -> f32 {
    return bitcast<f32>((word & 0xfffffe00u) >> 1u);
}

fn section_at(ray: u32, depth_mm: f32) -> Section {
    let step = min(u32(i32(depth_mm / params.map_step_mm)), params.map_depths - 2u);
    let at = ray * params.map_depths + step;
    let before = raster[at];
    let beyond_mm = depth_mm - f32(i32(step)) * params.map_step_mm;
    let rate0 = ONE_WAY * tissues[before & 255u].attenuation_np_mm;
    let sum0 = raster_sum(before);
    var sum = sum0 + rate0 * beyond_mm;
    var tissue = before & 255u;
    // The medium ends before the next depth. A loop, not an `if`: software devices skip a loop that no thread enters.
    loop {
        if (before & WHOLE) != 0u {
            break;
        }
        let after = raster[at + 1u];
        let sum1 = raster_sum(after);
        if tissue == (after & 255u) {
            sum = mix(sum0, sum1, clamp(beyond_mm / params.map_step_mm, 0.0, 1.0));
            break;
        }
        // Between two tissues, Σμ at both depths gives the position of the boundary.
        let rate1 = ONE_WAY * tissues[after & 255u].attenuation_np_mm;
        let contrast = rate0 - rate1;
        // If both attenuate alike, the position is unknown; halfway is within half a step.
        var boundary_mm = 0.5 * params.map_step_mm;
        if abs(contrast) > CONTRAST_MIN_NP_MM {
            boundary_mm = clamp((sum1 - sum0 - rate1 * params.map_step_mm) / contrast, 0.0, params.map_step_mm);
        }
        sum = sum0 + rate0 * min(beyond_mm, boundary_mm) + rate1 * max(beyond_mm - boundary_mm, 0.0);
        tissue = select(tissue, after & 255u, beyond_mm > boundary_mm);
        break;
    }
    return Section(sum, tissue);
}

// Fractions of the sector's width and depth from a packed position.
fn unpacked(position: u32) -> vec2<f32> {
    return vec2<f32>(f32(i32(position & ((1u << ACROSS_BITS) - 1u))) * ACROSS_SCALE, f32(i32(position >> ACROSS_BITS)) * DEPTH_SCALE);
}

// A pixel from its packed positions on the scanlines, which may be steered, and on the map rays, which are not.
fn convert(position: u32, map_position: u32, percentile_np: f32) -> Pixel {
    let at = unpacked(position);
    let across = at.x;
    let depth = at.y;
    let line = clamp(across * f32(params.scanlines) - 0.5, 0.0, f32(params.scanlines - 1u));
    let sample = clamp(depth * f32(params.samples) - 0.5, 0.0, f32(params.samples - 1u));
    let level = sample * f32(params.levels_per_sample);
    let level0 = u32(i32(level));
    let row_levels = params.row_samples * params.levels_per_sample;
    let row0 = u32(i32(line)) * row_levels;
    let row1 = min(u32(i32(line)) + 1u, params.scanlines - 1u) * row_levels;
    let along = fract(level);
    // A word holds a level and the next one; at the last sample, `along` is 0.
    let a = unpack2x16unorm(polar[row0 + level0]);
    let b = unpack2x16unorm(polar[row1 + level0]);
    let grey = u32(i32(255.0 * mix(mix(a.x, a.y, along), mix(b.x, b.y, along), fract(line)) + 0.5));
    let inside = position != OUTSIDE;
    if !MAPS {
        return Pixel(select(0u, grey, inside), 0u, 0u);
    }

    let map_at = unpacked(map_position);
    let mapped = map_position != OUTSIDE;
    let depth_mm = map_at.y * params.depth_mm;
    // Σμ is interpolated between map rays, and extrapolated by up to half a spacing beyond the outer ones. The tissue
    // is that of the nearer ray.
    let ray = map_at.x * f32(params.map_rays) - 0.5;
    let first = min(u32(i32(max(ray, 0.0))), max(params.map_rays, 2u) - 2u);
    let part = clamp(ray - f32(i32(first)), -0.5, 1.5);
    let one = section_at(first, depth_mm);
    let next = section_at(min(first + 1u, params.map_rays - 1u), depth_mm);
    let sum = max(mix(one.sum_np, next.sum_np, part), 0.0);
    let tissue = select(one.tissue, next.tissue, part >= 0.5);
    let ln_level = percentile_np - sum;
    let root = exp(0.5 * clamp(ln_level, LN_SILENT, 0.0));
    let steps = select(0u, u32(i32(ROOT_STEPS * root + 0.5)), mapped && ln_level > LN_SILENT);
    return Pixel(select(0u, grey, inside), select(0u, tissue + FIRST_TISSUE, mapped), steps);
}

@compute @workgroup_size(128)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.sector_words {
        return;
    }
    // Positions on straight scanlines come first, then those for each steering angle.
    let positions = pixels[params.angle_words + id.x];
    let straight = pixels[id.x];
    let word = words[id.x];
    let p = percentile[0];
    let p0 = convert(positions.x, straight.x, p);
    let p1 = convert(positions.y, straight.y, p);
    let p2 = convert(positions.z, straight.z, p);
    let p3 = convert(positions.w, straight.w, p);
    bmode[word] = p0.grey | p1.grey << 8u | p2.grey << 16u | p3.grey << 24u;
    if MAPS {
        attenuation[word] = vec2<u32>(p0.root | p1.root << 16u, p2.root | p3.root << 16u);
        segmentation[word] = p0.tissue | p1.tissue << 8u | p2.tissue << 16u | p3.tissue << 24u;
    }
}
