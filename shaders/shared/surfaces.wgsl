// Surfaces that a point is inside, one bit each; the highest set bit is the medium.

var<private> inside: array<u32, 8>;

fn set_inside(surface: u32, value: bool) {
    let word = surface >> 5u;
    let bit = 1u << (surface & 31u);
    inside[word] = select(inside[word] & ~bit, inside[word] | bit, value);
}

// Tissue of the medium, with MOVES if its surface moves: that of the highest surface the point is inside, else the
// background.
fn medium_word() -> u32 {
    for (var word = 7; word >= 0; word--) {
        if inside[word] != 0u {
            return surface_tissue[u32(word) * 32u + firstLeadingBit(inside[word])];
        }
    }
    return params.background;
}

fn medium() -> u32 {
    return medium_word() & TISSUE_MASK;
}
