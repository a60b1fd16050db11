"""Pictures cut into patches whose histograms are compared, as `src/quality/pkl.rs` does."""

# Side of a patch, pixels.
PATCH = 32
# Bins of a histogram over the grey levels, and what is added to the count of each.
BINS, PSEUDO_COUNT = 50, 0.5


def patches(picture, offset, side=PATCH):
    """Levels [patches, side * side] of the whole patches of pictures from `offset` pixels right of and below their corner."""
    picture = picture[:, 0, offset:, offset:]
    rows, columns = (picture.shape[1] // side, picture.shape[2] // side)
    picture = picture[:, : rows * side, : columns * side].reshape(-1, rows, side, columns, side)
    return picture.transpose(2, 3).reshape(-1, side * side)
