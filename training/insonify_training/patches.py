"""Patches of pictures for histogram comparison, as in `src/quality/pkl.rs`."""

# Side of a patch, pixels.
PATCH = 32
# Bins of a histogram over the grey levels, and the pseudo-count added to each.
BINS, PSEUDO_COUNT = 50, 0.5


def parts(counts):
    """Fractions of the levels in each bin [patches, bins] from their counts."""
    counts = counts + PSEUDO_COUNT
    return counts / counts.sum(1, keepdim=True)


def divergence(p, q):
    """Kullback-Leibler divergence D(p || q) of each patch, nats."""
    return (p * (p / q).log()).sum(1)


def patches(picture, offset, side=PATCH):
    """Levels [patches, side * side] of all complete patches, starting `offset` pixels from the upper left corner."""
    picture = picture[:, 0, offset:, offset:]
    rows, columns = (picture.shape[1] // side, picture.shape[2] // side)
    picture = picture[:, : rows * side, : columns * side].reshape(-1, rows, side, columns, side)
    return picture.transpose(2, 3).reshape(-1, side * side)
