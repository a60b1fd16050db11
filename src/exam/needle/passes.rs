//! Passes of a needle: advances that are separated by withdrawals.

/// Smallest withdrawal, and smallest advance after it, that make another pass, mm.
pub(super) const PASS_MM: f64 = 5.0;

/// Advances of a needle along its shaft.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Passes {
    /// Number of passes: 1, and one for each withdrawal and advance of more than [`PASS_MM`].
    pub(super) count: usize,
    /// Index at which the last advance was deepest.
    pub(super) deepest: usize,
}

/// Passes of a needle with these advances along its shaft, mm; positive deeper.
pub(super) fn passes(depths_mm: &[f64]) -> Passes {
    let mut passes = Passes { count: 1, deepest: 0 };
    let at = |index: usize| depths_mm.get(index).copied().unwrap_or_default();
    // Index of the shallowest position since a withdrawal.
    let mut withdrawn: Option<usize> = None;
    for (index, &depth_mm) in depths_mm.iter().enumerate() {
        match withdrawn {
            None if depth_mm > at(passes.deepest) => passes.deepest = index,
            None if depth_mm < at(passes.deepest) - PASS_MM => withdrawn = Some(index),
            Some(shallowest) if depth_mm < at(shallowest) => withdrawn = Some(index),
            Some(shallowest) if depth_mm > at(shallowest) + PASS_MM => {
                passes = Passes { count: passes.count + 1, deepest: index };
                withdrawn = None;
            }
            _ => {}
        }
    }
    passes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_withdrawals_and_advances_of_more_than_five_mm_count() {
        let count = |depths: &[f64]| (passes(depths).count, passes(depths).deepest);
        assert_eq!(count(&[]), (1, 0));
        assert_eq!(count(&[0.0, 10.0, 20.0]), (1, 2));
        assert_eq!(count(&[0.0, 20.0, 15.5, 19.0, 16.0, 22.0]), (1, 5), "tremor");
        assert_eq!(count(&[0.0, 20.0, 10.0, 5.0, 12.0, 30.0]), (2, 5));
        assert_eq!(count(&[0.0, 20.0, 10.0, 0.0]), (1, 1), "a needle that is drawn out");
        assert_eq!(count(&[0.0, 20.0, 10.0, 16.0, 10.0, 18.0, 0.0]), (3, 5));
    }
}
