//! Percentiles.

/// The value below which the part `part` (0..=1) of `values` lies, straight lines between neighbours in order: type 7 of
/// Hyndman and Fan 1996, NumPy's default. None of no values. Infinite values are ordered as numbers are; NaN is greatest.
pub fn percentile(values: &[f64], part: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let place = part.clamp(0.0, 1.0) * last as f64;
    let (below, weight) = (place.floor(), place.fract());
    let low = *sorted.get(below as usize)?;
    let high = *sorted.get((below as usize + 1).min(last))?;
    // An infinite neighbour of weight 0, and two infinite ones, would make NaN.
    Some(if weight == 0.0 || low == high { low } else { low + (high - low) * weight })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_lie_between_neighbours() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert_eq!([0.0, 0.5, 1.0].map(|p| percentile(&values, p)), [Some(1.0), Some(2.5), Some(4.0)]);
        assert!((percentile(&values, 0.05).unwrap() - 1.15).abs() < 1e-12);
        assert_eq!(percentile(&[7.0], 0.95), Some(7.0));
        assert_eq!(percentile(&[], 0.5), None);
    }

    #[test]
    fn infinite_values_do_not_make_nan() {
        let inf = f64::INFINITY;
        assert_eq!(percentile(&[1.0, inf, inf], 0.0), Some(1.0));
        assert_eq!(percentile(&[1.0, inf, inf], 0.25), Some(inf));
        assert_eq!(percentile(&[inf, inf], 0.05), Some(inf));
    }
}
