//! Fourier transforms of several rows at once, a row a lane.
//!
//! Radix-4 steps in place, and one radix-2 step if the length is an odd power of two. Spectra are in bit-reversed
//! order. The data is split into parts. All steps within one part precede those of the next, so a part stays in the L1
//! cache.

/// Rows transformed together.
pub(in crate::host) const LANES: usize = 8;
/// Greatest length of a part, complex numbers per row: 16 KiB for all rows, which fit in the L1 cache.
const PART_MAX: usize = 256;

/// One number of each row.
pub(in crate::host) type Row = [f32; LANES];

/// A complex number of each row: real parts, imaginary parts.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct Wide {
    pub(in crate::host) re: Row,
    pub(in crate::host) im: Row,
}

impl Wide {
    pub(in crate::host) const ZERO: Self = Self { re: [0.0; LANES], im: [0.0; LANES] };

    #[inline(always)]
    pub(in crate::host) fn plus(&self, other: &Self) -> Self {
        let mut sum = Self::ZERO;
        for i in 0..LANES {
            sum.re[i] = self.re[i] + other.re[i];
            sum.im[i] = self.im[i] + other.im[i];
        }
        sum
    }

    #[inline(always)]
    pub(in crate::host) fn minus(&self, other: &Self) -> Self {
        let mut difference = Self::ZERO;
        for i in 0..LANES {
            difference.re[i] = self.re[i] - other.re[i];
            difference.im[i] = self.im[i] - other.im[i];
        }
        difference
    }

    /// Product with a complex number that all rows share.
    #[inline(always)]
    pub(in crate::host) fn times(&self, [re, im]: [f32; 2]) -> Self {
        let mut product = Self::ZERO;
        for i in 0..LANES {
            product.re[i] = self.re[i] * re - self.im[i] * im;
            product.im[i] = self.re[i] * im + self.im[i] * re;
        }
        product
    }

    /// Product with i.
    #[inline(always)]
    pub(in crate::host) fn turned(&self) -> Self {
        let mut turned = Self { re: self.im, im: self.re };
        for re in &mut turned.re {
            *re = -*re;
        }
        turned
    }
}

/// Roots of unity for transforms of one length, a power of two.
#[derive(Debug, Clone)]
pub(in crate::host) struct Roots {
    /// e^(−i2πk/length).
    roots: Vec<[f32; 2]>,
}

impl Roots {
    pub(in crate::host) fn new(length: usize) -> Self {
        let root = |k: usize| {
            let (sin, cos) = (-std::f64::consts::TAU * k as f64 / length as f64).sin_cos();
            [cos as f32, sin as f32]
        };
        Self { roots: (0..length).map(root).collect() }
    }

    /// Σ x_n e^(−i2πkn/length) of each row, in bit-reversed order of k.
    #[inline(always)]
    pub(in crate::host) fn forward(&self, data: &mut [Wide]) {
        self.begin_forward(data);
        for part in data.chunks_exact_mut(self.part()) {
            self.end_forward(part);
        }
    }

    /// Σ X_k e^(+i2πkn/length) of each row, from the bit-reversed order of k. Steps within each part precede steps
    /// across parts.
    #[cfg(test)]
    fn inverse(&self, data: &mut [Wide]) {
        for part in data.chunks_exact_mut(self.part()) {
            self.begin_inverse(part);
        }
        self.end_inverse(data);
    }

    /// Length of the parts that [`Self::end_forward`] and [`Self::begin_inverse`] process one at a time.
    #[inline(always)]
    pub(in crate::host) fn part(&self) -> usize {
        let mut part = self.roots.len();
        if part.trailing_zeros() % 2 == 1 {
            part /= 2;
        }
        while part > PART_MAX {
            part /= 4;
        }
        part
    }

    /// Steps of [`Self::forward`] across parts.
    #[inline(always)]
    pub(in crate::host) fn begin_forward(&self, data: &mut [Wide]) {
        let mut block = self.roots.len();
        if block.trailing_zeros() % 2 == 1 {
            block /= 2;
            let (low, high) = data.split_at_mut(block);
            for (j, (a, b)) in low.iter_mut().zip(high).enumerate() {
                let difference = a.minus(b);
                *a = a.plus(b);
                *b = difference.times(self.roots[j]);
            }
        }
        while block > PART_MAX {
            self.divide(data, block);
            block /= 4;
        }
    }

    /// Steps of [`Self::forward`] within one part.
    #[inline(always)]
    pub(in crate::host) fn end_forward(&self, part: &mut [Wide]) {
        let mut block = part.len();
        while block >= 4 {
            self.divide(part, block);
            block /= 4;
        }
    }

    /// Steps of [`Self::inverse`] within one part.
    #[inline(always)]
    pub(in crate::host) fn begin_inverse(&self, part: &mut [Wide]) {
        let mut block = 4;
        while block <= part.len() {
            self.combine(part, block);
            block *= 4;
        }
    }

    /// Steps of [`Self::inverse`] across parts.
    #[inline(always)]
    pub(in crate::host) fn end_inverse(&self, data: &mut [Wide]) {
        let length = self.roots.len();
        let odd = length.trailing_zeros() % 2 == 1;
        let mut block = 4 * self.part();
        while block <= if odd { length / 2 } else { length } {
            self.combine(data, block);
            block *= 4;
        }
        if odd {
            let (low, high) = data.split_at_mut(length / 2);
            for (j, (a, b)) in low.iter_mut().zip(high).enumerate() {
                let turned = b.times(conjugate(self.roots[j]));
                *b = a.minus(&turned);
                *a = a.plus(&turned);
            }
        }
    }

    /// A radix-4 step of the transform: divides each block of numbers into quarters.
    #[inline(always)]
    fn divide(&self, data: &mut [Wide], block: usize) {
        let stride = self.roots.len() / block;
        for part in data.chunks_exact_mut(block) {
            let [a, b, c, d] = quarters(part);
            for (j, (((a, b), c), d)) in a.iter_mut().zip(b).zip(c).zip(d).enumerate() {
                let (t0, t1) = (a.plus(c), a.minus(c));
                let (t2, t3) = (b.plus(d), d.minus(b).turned());
                let (w1, w2) = (self.roots[j * stride], self.roots[2 * j * stride]);
                let w3 = self.roots[3 * j * stride];
                *a = t0.plus(&t2);
                *b = t0.minus(&t2).times(w2);
                *c = t1.plus(&t3).times(w1);
                *d = t1.minus(&t3).times(w3);
            }
        }
    }

    /// A radix-4 step of the inverse: combines the quarters of each block.
    #[inline(always)]
    fn combine(&self, data: &mut [Wide], block: usize) {
        let stride = self.roots.len() / block;
        for part in data.chunks_exact_mut(block) {
            let [a, b, c, d] = quarters(part);
            for (j, (((a, b), c), d)) in a.iter_mut().zip(b).zip(c).zip(d).enumerate() {
                let (w1, w2) = (conjugate(self.roots[j * stride]), conjugate(self.roots[2 * j * stride]));
                let w3 = conjugate(self.roots[3 * j * stride]);
                let (y1, y2, y3) = (c.times(w1), b.times(w2), d.times(w3));
                let (t0, t2) = (a.plus(&y2), a.minus(&y2));
                let (t1, t3) = (y1.plus(&y3), y1.minus(&y3).turned());
                *a = t0.plus(&t1);
                *c = t0.minus(&t1);
                *b = t2.plus(&t3);
                *d = t2.minus(&t3);
            }
        }
    }
}

#[inline(always)]
fn conjugate([re, im]: [f32; 2]) -> [f32; 2] {
    [re, -im]
}

/// Transpose of eight rows of eight numbers.
#[inline(always)]
pub(in crate::host) fn transposed([a, b, c, d, e, f, g, h]: [Row; LANES]) -> [Row; LANES] {
    let ([a, e], [b, f]) = (exchanged::<4>(a, e), exchanged::<4>(b, f));
    let ([c, g], [d, h]) = (exchanged::<4>(c, g), exchanged::<4>(d, h));
    let ([a, c], [b, d]) = (exchanged::<2>(a, c), exchanged::<2>(b, d));
    let ([e, g], [f, h]) = (exchanged::<2>(e, g), exchanged::<2>(f, h));
    let ([a, b], [c, d]) = (exchanged::<1>(a, b), exchanged::<1>(c, d));
    let ([e, f], [g, h]) = (exchanged::<1>(e, f), exchanged::<1>(g, h));
    [a, b, c, d, e, f, g, h]
}

/// One step of a transposition: swaps the groups of `APART` numbers with odd index in `a` and with even index in `b`.
#[inline(always)]
fn exchanged<const APART: usize>(a: Row, b: Row) -> [Row; 2] {
    let (mut low, mut high) = ([0.0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        let odd = lane & APART != 0;
        low[lane] = if odd { b[lane ^ APART] } else { a[lane] };
        high[lane] = if odd { b[lane] } else { a[lane ^ APART] };
    }
    [low, high]
}

/// The four quarters of a slice.
#[inline(always)]
fn quarters(part: &mut [Wide]) -> [&mut [Wide]; 4] {
    let quarter = part.len() / 4;
    let (low, high) = part.split_at_mut(2 * quarter);
    let (a, b) = low.split_at_mut(quarter);
    let (c, d) = high.split_at_mut(quarter);
    [a, b, c, d]
}

/// Index of `k` in a spectrum of `length` in bit-reversed order.
pub(in crate::host) fn reversed(k: usize, length: usize) -> usize {
    match length.trailing_zeros() {
        0 => 0,
        bits => k.reverse_bits() >> (usize::BITS - bits),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data(length: usize) -> Vec<Wide> {
        let number =
            |n: usize, lane: usize, part: usize| (((n * 37 + lane * 101 + part * 53) % 97) as f32) / 48.0 - 1.0;
        let wide = |n| Wide {
            re: std::array::from_fn(|lane| number(n, lane, 0)),
            im: std::array::from_fn(|lane| number(n, lane, 1)),
        };
        (0..length).map(wide).collect()
    }

    #[test]
    fn spectra_are_fourier_sums() {
        for length in [8, 16, 32, 128, 256, 512, 1024, 2048] {
            let input = data(length);
            let mut spectrum = input.clone();
            Roots::new(length).forward(&mut spectrum);
            for k in [0, 1, length / 3, length - 1] {
                let got = spectrum[reversed(k, length)];
                for lane in [0, LANES / 2, LANES - 1] {
                    let (mut re, mut im) = (0.0, 0.0);
                    for (n, value) in input.iter().enumerate() {
                        let (sin, cos) = (-std::f64::consts::TAU * (k * n) as f64 / length as f64).sin_cos();
                        let (x, y) = (f64::from(value.re[lane]), f64::from(value.im[lane]));
                        re += x * cos - y * sin;
                        im += x * sin + y * cos;
                    }
                    let error = (f64::from(got.re[lane]) - re).hypot(f64::from(got.im[lane]) - im);
                    assert!(error < 1e-5 * length as f64, "{length}, {k}: {error}");
                }
            }
        }
    }

    #[test]
    fn rows_and_cells_are_exchanged() {
        let rows: [Row; LANES] = std::array::from_fn(|row| std::array::from_fn(|cell| (10 * row + cell) as f32));
        for (cell, lanes) in transposed(rows).iter().enumerate() {
            for (row, &value) in lanes.iter().enumerate() {
                assert_eq!(value, (10 * row + cell) as f32);
            }
        }
    }

    #[test]
    fn the_inverse_undoes_the_transform() {
        for length in [8, 16, 64, 128, 512, 1024, 4096] {
            let input = data(length);
            let mut output = input.clone();
            let roots = Roots::new(length);
            roots.forward(&mut output);
            roots.inverse(&mut output);
            for (a, b) in input.iter().zip(&output) {
                for lane in 0..LANES {
                    assert!((a.re[lane] - b.re[lane] / length as f32).abs() < 1e-5);
                    assert!((a.im[lane] - b.im[lane] / length as f32).abs() < 1e-5);
                }
            }
        }
    }
}
