// Paths through the scene: refraction, reflection, attenuation and the echoes of interfaces.
// In: ray table, BVH, surfaces around each start. Out: for each path up to SEGMENTS straight segments, each with the
// echo of the interface that it begins at.
// A path by one thread (shared/path_alone.wgsl) or by a few lanes (shared/path_by_lanes.wgsl). Order of paths: rays
// fastest, then scanlines, then layers; then the axial paths.

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> triangles: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> surface_tissue: array<u32>;
@group(0) @binding(4) var<storage, read> rays: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> starts_inside: array<u32>;
@group(0) @binding(6) var<storage, read_write> overflows: array<atomic<u32>>;
@group(0) @binding(7) var<uniform> tissues: array<Tissue, TISSUES_MAX>;
// Range at which each segment starts, mm; after the last one, a range beyond every sample.
@group(0) @binding(8) var<storage, read_write> starts: array<f32>;
@group(0) @binding(9) var<storage, read_write> segments: array<Segment>;
// Amplitude, and range in mm, of the echo of the interface that a segment begins at.
@group(0) @binding(10) var<storage, read_write> echoes: array<vec2<f32>>;
@group(0) @binding(11) var<storage, read_write> segment_counts: array<u32>;
// Index of the segment that contains the first sample of each block of HINT_BLOCK samples, four to a word.
@group(0) @binding(12) var<storage, read_write> hints: array<u32>;
// Displacement of each triangle from its rest position, mm; read if MOVING.
@group(0) @binding(13) var<storage, read> displacements: array<vec4<f32>>;
// One-way amplitude that each path's part of the face passes into the body.
@group(0) @binding(14) var<storage, read> couplings: array<f32>;

// Whether anything in the scene moves.
override MOVING: bool = false;
// Effects that are simulated. If one is off, the tables also hold values with which its arithmetic does nothing.
override REFRACTION: bool = true;
override INTERFACE_ECHOES: bool = true;
override ROUGHNESS: bool = true;
override REFLECTIONS: bool = true;
override APERTURE: bool = false;

// Capacity for the crossings of a path up to its first reflection, and then for coincident ones.
const CROSSINGS: u32 = CROSSINGS_OF_A_PATH;

// Normal of a random microfacet on a surface with normal `n`: Beckmann's distribution of slopes, with mean square
// `variance`. `u` and `v` are random numbers in 0..1.
fn microfacet(n: vec3<f32>, variance: f32, u: f32, v: f32) -> vec3<f32> {
    let slope = sqrt(max(-variance * log(max(1.0 - u, 1.0e-7)), 0.0));
    let helper = select(vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0), abs(n.x) > 0.7);
    let tangent = normalize(cross(helper, n));
    let bitangent = cross(n, tangent);
    let angle = 6.28318530718 * v;
    return normalize(n + slope * (cos(angle) * tangent + sin(angle) * bitangent));
}

// Mean square slope of the reflected rays that the aperture accepts from a surface at `range_mm`.
fn aperture_variance(range_mm: f32) -> f32 {
    let half_angle = clamp(APERTURE_HALF_ANGLE * params.aperture_mm / max(range_mm, 1.0), APERTURE_HALF_ANGLE_MIN, APERTURE_HALF_ANGLE_MAX);
    return half_angle * half_angle;
}

// Fraction of a reflected beam's energy that falls into the aperture, for a surface whose slopes have this variance.
fn acceptance(variance: f32, range_mm: f32) -> f32 {
    let aperture = aperture_variance(range_mm);
    return aperture / (aperture + variance);
}

// Fraction of the reflected pressure that returns to the aperture: a Gaussian lobe about the facet, and a diffuse part.
// The lobe's variance is the aperture's plus half of the squared roughness.
fn returning(cos_facet: f32, roughness: f32, range_mm: f32) -> f32 {
    let rough2 = roughness * roughness;
    let lobe2 = aperture_variance(range_mm) + 0.5 * rough2;
    let cos2 = max(cos_facet * cos_facet, 1.0e-6);
    let tan2 = max(1.0 - cos2, 0.0) / cos2;
    let specular = acceptance(0.5 * rough2, range_mm) * exp(-min(tan2 / lobe2, 80.0));
    let diffuse = DIFFUSE * rough2 / (rough2 + DIFFUSE_HALF_ROUGHNESS2) * cos2;
    return sqrt(specular + diffuse);
}

// Triangle that acts as the interface among the coincident crossings `first`..`end`. It belongs to the highest surface;
// of several, it is the first one in the scene.
fn interface_of(first: u32, end: u32) -> u32 {
    var chosen = 0u;
    var chosen_surface = 0u;
    var chosen_triangle = 0xffffffffu;
    for (var i = first; i < end; i++) {
        let surface = crossing_surface(i);
        let triangle = triangles[3u * (crossing_key[i] >> 1u) + 1u].w;
        if surface > chosen_surface || (surface == chosen_surface && triangle < chosen_triangle) {
            chosen = crossing_key[i] >> 1u;
            chosen_surface = surface;
            chosen_triangle = triangle;
        }
    }
    return chosen;
}

// Amplitude weight of a path's echoes that add in power with those of other paths, for its `part` of the beam.
fn echo_power_weight(part: f32) -> f32 {
    return sqrt(part * min(1.0, CELLS_OF_A_BEAM * part));
}

// Whether a path follows reflections. The paths that follow reflections are spread evenly over the rays and layers of a
// scanline. From scanline to scanline, they shift by the golden ratio.
fn follows_reflections(line_ray: u32, layer: u32) -> bool {
    let paths = params.rays * params.layers;
    let in_line = layer * params.rays + line_ray % params.rays;
    let shift = ((((line_ray / params.rays + params.seed) * KRONECKER[0]) >> 16u) * paths) >> 16u;
    return (in_line * params.reflecting_paths + shift) % paths < params.reflecting_paths;
}

fn trace_path(path: u32) {
    let of_layer = params.line_count * params.rays;
    if path >= of_layer * params.layer_count + params.axial_paths {
        return;
    }
    let is_axial = is_axial_path(path);
    let line_ray = params.line_first * params.rays + path % of_layer;
    // Axial paths are the same in all batches.
    let layer = select(params.layer_first + path / of_layer, 0u, is_axial);
    // Over rays and layers, echoes in phase add in amplitude, others in power. An axial path has full weight, since its
    // echoes replace those that reflected paths miss.
    let path_weight = 1.0 / f32(params.rays * params.layers);
    var weight_in_phase = select(path_weight, 1.0, is_axial);
    var weight_power = echo_power_weight(weight_in_phase);
    let follows = is_axial || follows_reflections(line_ray, layer);
    // The range of a straight path is its depth: the lens delays its middle, so echoes of oblique layers come no later.
    let stretch = elevation_of(path).z;

    for (var word = 0u; word < 8u; word++) {
        inside[word] = starts_inside[path * 8u + word];
    }
    let ray = launch(path);
    var origin = ray.origin;
    var direction = ray.direction;
    let face_depth_mm = dot(vec3<f32>(params.lateral.w, params.elevational.w, params.axial.w), params.axial.xyz);
    var range_mm = 0.0;
    // Range that this path saved in fast hard bodies, mm. The aperture's sound goes past such bodies and saves none.
    var behind_mm = 0.0;
    let coupling = couplings[path];
    let ln_coupling = select(2.0 * max(log(max(coupling, 1.0e-37)), LN_UNCOUPLED), 0.0, coupling == 1.0);
    var ln_amplitude = ln_coupling;
    // ln of a factor for scatterers alone. Their powers add over the paths, so the random choice of reflection makes
    // half of an interface's loss in nepers; this is the other half.
    var ln_scatter = 0.0;
    // ln of a second factor for scatterers alone: a path that has reflected also stands for the paths that follow no
    // reflections.
    var ln_share = 0.0;
    // ln amplitude of a wave that passes every interface, and whether the path has reflected.
    var ln_passed = ln_coupling;
    var has_reflected = false;
    here_depth_mm = ray.face_depth_mm;
    var here = medium();
    var bounce = 0u;
    var reflections = 0u;
    var echo = 0.0;
    var echo_range_mm = 0.0;
    var count = 0u;
    var t_min = 0.0;
    // Without coupling the path ends. With APERTURE it goes on, since other parts of the face may reach what lies
    // below.
    var open = coupling > 0.0 || APERTURE;
    var lost = 0u;
    var crossed = 0u;
    // Displacement of the medium from rest, mm: scatterers are looked up at rest, so that speckle moves with its
    // tissue.
    var carried_mm = vec3<f32>(0.0);
    // A path is straight until it reflects. One traversal finds its crossings, which are complete up to `known_mm`.
    let start = origin;
    let line_mm = FAST_MEDIA * stretch * params.depth_mm;
    if open {
        collect(start, direction, 0.0, line_mm);
    }
    let known_mm = min(line_mm, crossing_lost_mm) - TOUCH_MM;
    var on_line = true;
    var travelled_mm = 0.0;
    var next = 0u;
    loop {
        // Writes the segment that begins here. Once the capacity is used up, it replaces the last one, whose stretch
        // then counts as the medium before.
        count = min(count, SEGMENTS - 1u);
        let tissue = tissues[here];
        let at = path * SEGMENTS + count;
        // Whether the aperture gain replaces the path's own loss.
        let by_aperture = APERTURE && !has_reflected;
        // With the aperture, slow hard media delay nothing beyond them.
        let speed_ratio_here = select(tissue.speed_ratio, max(tissue.speed_ratio, tissue.aperture_speed_ratio), by_aperture);
        let path_per_range = speed_ratio_here * stretch;
        let aperture_path_per_range = select(path_per_range, tissue.aperture_speed_ratio * stretch, by_aperture);
        let step = direction * path_per_range;
        // The loss of a fast body is spread over the range that the body takes up for the aperture.
        let fall = tissue.attenuation_np_mm * aperture_path_per_range;
        if is_writer() {
            starts[path * STARTS + count] = range_mm;
            segments[at] = Segment(
                origin - carried_mm - step * range_mm,
                ln_amplitude + ln_scatter + ln_share + fall * range_mm,
                step,
                fall,
                tissue.scatterer_mean,
                tissue.scatterer_deviation,
                TAG | select(0u, HAS_REFLECTED, has_reflected) | tissue.scatterers,
                ln_passed + fall * select(range_mm, 0.0, has_reflected));
            echoes[at] = vec2<f32>(echo, echo_range_mm);
        }
        count++;
        if !open {
            break;
        }

        // Advances to the next change of medium.
        var there = here;
        var chosen = 0u;
        var before = inside;
        var moves = false;
        var done = false;
        loop {
            let left_mm = (params.depth_mm - range_mm) * path_per_range;
            var t = -1.0;
            if on_line {
                let ahead_mm = select(BEYOND_MM, crossing_t[min(next, CROSSINGS - 1u)], next < crossing_count);
                on_line = min(travelled_mm + left_mm, ahead_mm) <= known_mm;
                t = select(-1.0, ahead_mm - travelled_mm, ahead_mm - travelled_mm <= left_mm);
            }
            if !on_line {
                t = nearest(origin, direction, t_min, left_mm);
            }
            if t < 0.0 || left_mm <= 0.0 {
                done = true;
                break;
            }
            crossed++;
            if crossed > PLACES_MAX {
                lost++;
                done = true;
                break;
            }
            // Coincident crossings: the nearest one, and all others within TOUCH_MM of it.
            if !on_line {
                next = 0u;
                crossing_count = 1u;
                crossing_t[0] = t;
                crossing_key[0] = nearest_key;
                while nearest_crowded {
                    collect(origin, direction, max(t_min, t - TOUCH_MM), min(t + TOUCH_MM, left_mm));
                    lost += crossing_lost;
                    nearest_crowded = false;
                }
            }
            before = inside;
            let first = next;
            next = cross_coincident(first);
            chosen = interface_of(first, next);
            if on_line {
                travelled_mm = crossing_t[first];
                origin = start + direction * travelled_mm;
            } else {
                origin += direction * t;
            }
            here_depth_mm = dot(origin, params.axial.xyz) - face_depth_mm;
            let word = medium_word();
            there = word & TISSUE_MASK;
            moves = (word & MOVES) != 0u;
            let passed_mm = t / path_per_range;
            range_mm += passed_mm;
            behind_mm += t / aperture_path_per_range - passed_mm;
            ln_amplitude -= tissue.attenuation_np_mm * t;
            ln_passed -= tissue.attenuation_np_mm * t;
            t_min = TOUCH_MM;
            if there != here {
                break;
            }
        }
        if done {
            break;
        }

        let index = chosen;
        let surface = triangles[3u * index].w;
        var normal = cross(bitcast<vec3<f32>>(triangles[3u * index + 1u].xyz), bitcast<vec3<f32>>(triangles[3u * index + 2u].xyz));
        normal = normal / max(length(normal), 1.0e-30);
        if dot(normal, direction) > 0.0 {
            normal = -normal;
        }
        let beyond = tissues[there];
        // An interface has the larger roughness and thickness of its two sides, and the smaller coherence.
        let roughness = max(tissue.roughness, beyond.roughness);
        let thickness_mm = max(tissue.thickness_mm, beyond.thickness_mm);
        let coherence = min(tissue.coherence, beyond.coherence);
        // Half of the roughness tilts the facet, the other half widens the lobe about the facet.
        let variance = 0.5 * roughness * roughness;
        var facet = normal;
        if ROUGHNESS && variance > 0.0 && (!is_axial || params.rays * params.layers == 1u) {
            facet = microfacet(normal, variance, sample_unit(line_ray, layer, bounce, 1u), sample_unit(line_ray, layer, bounce, 2u));
            if dot(facet, direction) > -FACET_COS_MIN {
                facet = normal;
            }
        }
        // Echoes depend on the facet; paths follow the mean surface.
        let cos_facet = clamp(-dot(facet, direction), 0.0, 1.0);
        let cos_incident = clamp(-dot(normal, direction), 0.0, 1.0);
        // A division may round x/x to a number other than 1.
        let speed_ratio = select(beyond.bending / tissue.bending, 1.0, beyond.bending == tissue.bending);
        let z1 = tissue.impedance_mrayl;
        let z2 = beyond.impedance_mrayl;
        let split = interface_between(z1, z2, speed_ratio, cos_incident);

        // The echo is shifted within the interface's thickness by a hash of the position.
        echo_range_mm = range_mm;
        if INTERFACE_ECHOES {
            var at_facet = split;
            if ROUGHNESS {
                at_facet = interface_between(z1, z2, speed_ratio, cos_facet);
            }
            let offset = unit(lattice_hash(lattice_cell(origin + OFF_THE_GRID_MM) ^ vec3<i32>(i32(surface + 1u) * SURFACE_SALT)).x) - 0.5;
            echo_range_mm += offset * thickness_mm / path_per_range;
            let weight = mix(weight_power, weight_in_phase, coherence);
            // For a path that has not reflected, the pass `echo` applies the aperture gain instead of the path's loss.
            let ln_arriving = select(ln_amplitude, 0.0, APERTURE && !has_reflected);
            echo = at_facet.pressure_reflection * returning(cos_facet, roughness, range_mm) * weight
                * select(0.0, exp(max(ln_arriving, LN_SILENT)), ln_arriving > LN_SILENT);
        }

        // Reflects with probability R, else transmits. Reflections that hardly return are not followed. An axial path
        // takes the likelier way, so that positions of scatterers don't depend on chance.
        let accepted = acceptance(roughness * roughness, range_mm);
        let follow = REFLECTIONS && follows && split.energy_reflection * accepted >= REFLECTION_FOLLOWED;
        // With the aperture, an axial path passes every interface: its scatterers are what the aperture sees beyond it.
        let reflects = REFLECTIONS && !(APERTURE && is_axial) && (split.energy_reflection >= 1.0
            || (follow && select(sample_unit(line_ray, layer, bounce, 0u), 0.5, is_axial) < split.energy_reflection));
        let ln_through = log(max(1.0 - split.energy_reflection, 1.0e-30));
        ln_passed += select(ln_through, 0.0, has_reflected);
        if reflects && !has_reflected && !is_axial && params.reflecting_paths < params.rays * params.layers {
            // From now on the path stands for those that follow no reflections, too. Powers of scatterers add over the
            // paths.
            weight_in_phase = 1.0 / f32(params.reflecting_paths);
            weight_power = echo_power_weight(weight_in_phase);
            ln_share = 0.5 * log(weight_in_phase / path_weight);
        }
        has_reflected = has_reflected || reflects;
        if reflects {
            inside = before;
            on_line = false;
            reflections++;
            // Total reflection turns back every path; only those that follow reflections go on.
            open = follows && reflections <= params.reflections_max;
            // A rough surface spreads part of the beam beyond the aperture, when sent and when received.
            ln_amplitude += log(accepted);
            ln_scatter += 0.5 * log(max(split.energy_reflection, 1.0e-30));
            var turned = direction + 2.0 * cos_facet * facet;
            if dot(turned, normal) <= 0.0 {
                turned = direction - 2.0 * dot(direction, normal) * normal;
            }
            direction = normalize(turned);
        } else {
            if follow {
                ln_scatter += 0.5 * ln_through;
            } else {
                ln_amplitude += ln_through;
            }
            here = there;
            if by_aperture && beyond.speed_ratio <= beyond.aperture_speed_ratio {
                // Sound from beyond a fast body goes past the body, so the range that it saved is added again.
                range_mm += behind_mm;
                behind_mm = 0.0;
            }
            if MOVING {
                carried_mm = select(vec3<f32>(0.0), displacements[chosen].xyz, moves);
            }
            // Until a path reflects, beams bend by the delays over the aperture, not by the facet that the path meets.
            if REFRACTION && has_reflected {
                let cos_beyond = split.cos_transmitted;
                let bent = speed_ratio * direction + (speed_ratio * cos_incident - cos_beyond) * normal;
                if cos_beyond > 0.0 && dot(bent, normal) < 0.0 {
                    direction = normalize(bent);
                }
            }
        }
        // Ends paths below −260 dB, which no display shows.
        open = open && ((APERTURE && !has_reflected) || ln_amplitude > LN_GIVEN_UP);
        if !open {
            ln_amplitude = 2.0 * LN_SILENT;
        }
        bounce++;
    }
    if !is_writer() {
        return;
    }
    segment_counts[path] = count;
    starts[path * STARTS + count] = BEYOND_MM;
    var holds = 0u;
    for (var word = 0u; word < params.hint_words; word++) {
        var packed = 0u;
        for (var i = 0u; i < 4u; i++) {
            let sample = (word * 4u + i) * HINT_BLOCK;
            let at_mm = (f32(sample) + 0.5) * params.sample_spacing_mm;
            while starts[path * STARTS + holds + 1u] <= at_mm {
                holds++;
            }
            packed |= holds << (8u * i);
        }
        hints[path * params.hint_words + word] = packed;
    }
    if lost > 0u {
        atomicAdd(&overflows[0], lost);
    }
}
