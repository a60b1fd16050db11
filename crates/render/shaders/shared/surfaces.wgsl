// Bit set of the surfaces that the current point is inside; the surface of the highest bit is the medium.

var<private> inside: array<u32, 8>;

// Depth of the current point below the apex of the face, mm: outside all surfaces, air lies deeper than the film of
// gel.
var<private> here_depth_mm: f32;

fn is_inside() -> bool {
    var any = 0u;
    for (var word = 0; word < 8; word++) {
        any |= inside[word];
    }
    return any != 0u;
}

// Coupling of a ray to the body, one-way amplitude. It is 1 if the ray starts inside a surface. Otherwise it depends on
// the gap beyond the gel up to the first crossing, `ahead_mm` along the ray; `none` says that there is no crossing. The
// ray starts `face_depth_mm` below the face's apex and goes `down` mm deeper per mm.
fn coupling_of(face_depth_mm: f32, down: f32, ahead_mm: f32, none: bool) -> f32 {
    let gap_mm = clamp(face_depth_mm + down * ahead_mm - params.film_mm, 0.0, GAP_MAX_MM);
    let film = select(exp(-GAP_NP_MM * gap_mm * gap_mm / (1.0 + gap_mm)), 0.0, none || gap_mm >= GAP_MAX_MM);
    return select(film, 1.0, params.film_mm < 0.0 || is_inside());
}

fn set_inside(surface: u32, value: bool) {
    let word = surface >> 5u;
    let bit = 1u << (surface & 31u);
    inside[word] = select(inside[word] & ~bit, inside[word] | bit, value);
}

// Tissue index of the medium, with MOVES if its surface moves: that of the highest surface around the point. Outside
// all surfaces, the background, or air deeper than the film of gel.
fn medium_word() -> u32 {
    for (var word = 7; word >= 0; word--) {
        if inside[word] != 0u {
            return surface_tissue[u32(word) * 32u + firstLeadingBit(inside[word])];
        }
    }
    return select(params.background, params.beyond, here_depth_mm > params.film_mm);
}

fn medium() -> u32 {
    return medium_word() & TISSUE_MASK;
}
