//! Percentiles, medians, means and least-squares lines.
//!
//! Two definitions of a percentile are in use. Percentiles of times are nearest ranks, so each is a time that
//! occurred. Percentiles of image metrics are interpolated, like NumPy's default.

/// Nearest-rank percentile: the smallest value that at least the fraction `part` (0..=1) of the values do not exceed.
/// `sorted` is ascending. `None` if it is empty.
pub fn nearest_rank<T: Copy>(sorted: &[T], part: f64) -> Option<T> {
    let rank = (part * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.clamp(1, sorted.len().max(1)) - 1).copied()
}

/// Upper median: the middle value, or the upper of the two middle values if their number is even. `sorted` is
/// ascending. `None` if it is empty.
pub fn upper_median<T: Copy>(sorted: &[T]) -> Option<T> {
    sorted.get(sorted.len() / 2).copied()
}

/// Indices of `count` items spread evenly over `total` items. `count` is at most `total`.
pub fn evenly(count: usize, total: usize) -> impl Iterator<Item = usize> {
    (0..count).map(move |i| (2 * i + 1) * total / (2 * count))
}

/// `values` in ascending order. Infinities sort like other numbers, positive NaN last.
pub fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.into_iter().collect();
    sorted.sort_by(f64::total_cmp);
    sorted
}

/// Interpolated percentile: the value below which the fraction `part` (0..=1) of `values` lies, linear between sorted
/// neighbours. Type 7 of Hyndman and Fan 1996, NumPy's default. `None` without values.
pub fn percentile(values: &[f64], part: f64) -> Option<f64> {
    let sorted = sorted(values.iter().copied());
    let last = sorted.len().checked_sub(1)?;
    let rank = part.clamp(0.0, 1.0) * last as f64;
    let (below, weight) = (rank.floor(), rank.fract());
    let low = *sorted.get(below as usize)?;
    let high = *sorted.get((below as usize + 1).min(last))?;
    // Infinite neighbours would give NaN: 0 · ∞ or ∞ − ∞.
    Some(if weight == 0.0 || low == high { low } else { low + (high - low) * weight })
}

/// Interpolated median: the mean of the two middle values if their number is even. `None` without values.
pub fn median(values: &[f64]) -> Option<f64> {
    percentile(values, 0.5)
}

/// Arithmetic mean. `None` without values.
pub fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut count = 0_u64;
    let sum: f64 = values.into_iter().inspect(|_| count += 1).sum();
    (count > 0).then(|| sum / count as f64)
}

/// Mean and population standard deviation. `None` without values.
pub fn mean_and_deviation(values: &[f64]) -> Option<(f64, f64)> {
    let mean_of_all = mean(values.iter().copied())?;
    let variance = mean(values.iter().map(|v| (v - mean_of_all).powi(2)))?;
    Some((mean_of_all, variance.sqrt()))
}

/// Least-squares slope of y over x, and its standard error, for points (x, y). The slope is NaN if x does not vary.
/// The error is not finite for fewer than three points.
pub fn slope(points: &[(f64, f64)]) -> (f64, f64) {
    let n = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let xx: f64 = points.iter().map(|p| (p.0 - x).powi(2)).sum();
    let slope = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / xx;
    let left = points.iter().map(|p| (p.1 - y - slope * (p.0 - x)).powi(2)).sum::<f64>();
    (slope, (left / (n - 2.0) / xx).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nearest_ranks_are_values_that_occurred() {
        let values: Vec<u32> = (1..=100).collect();
        assert_eq!([0.0, 0.5, 0.95, 1.0].map(|p| nearest_rank(&values, p)), [1, 50, 95, 100].map(Some));
        assert_eq!([0.05, 0.95].map(|p| nearest_rank(&[7], p)), [Some(7); 2]);
        assert_eq!(nearest_rank(&[1, 2, 3], 0.5), Some(2));
        assert_eq!(nearest_rank(&[1, 2, 3, 4], 0.75), Some(3));
        assert_eq!(nearest_rank::<u32>(&[], 0.5), None);
        assert_eq!(nearest_rank(&[1, 2], 9.0), Some(2));
    }

    #[test]
    fn the_upper_median_is_the_upper_one_of_two() {
        assert_eq!((upper_median(&[1, 2, 3]), upper_median(&[1, 2, 3, 4])), (Some(2), Some(3)));
        assert_eq!(upper_median::<u32>(&[]), None);
    }

    #[test]
    fn interpolated_percentiles_lie_between_neighbours() {
        let values = [4.0, 1.0, 3.0, 2.0];
        assert_eq!([0.0, 0.5, 1.0].map(|p| percentile(&values, p)), [Some(1.0), Some(2.5), Some(4.0)]);
        assert!((percentile(&values, 0.05).unwrap() - 1.15).abs() < 1e-12);
        assert_eq!(percentile(&[7.0], 0.95), Some(7.0));
        assert_eq!(percentile(&[], 0.5), None);
        assert_eq!(median(&[3.0, 1.0, 2.0]), Some(2.0));
    }

    #[test]
    fn infinite_values_do_not_make_nan() {
        let inf = f64::INFINITY;
        assert_eq!(percentile(&[1.0, inf, inf], 0.0), Some(1.0));
        assert_eq!(percentile(&[1.0, inf, inf], 0.25), Some(inf));
        assert_eq!(percentile(&[inf, inf], 0.05), Some(inf));
    }

    #[test]
    fn means_and_deviations_worked_out_by_hand() {
        assert_eq!(mean([10.0, 10.0, 10.0, 30.0, 10.0]), Some(14.0));
        assert_eq!(mean_and_deviation(&[10.0, 10.0, 10.0, 30.0, 10.0]), Some((14.0, 8.0)));
        assert_eq!((mean([]), mean_and_deviation(&[])), (None, None));
    }

    #[test]
    fn slopes_of_lines_are_exact_and_have_no_error() {
        let (rise, error) = slope(&[(0.0, 1.0), (1.0, 3.0), (2.0, 5.0)]);
        assert_eq!((rise, error), (2.0, 0.0));
        let (rise, error) = slope(&[(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)]);
        assert!(rise == 0.0 && (error - (1.0_f64 / 3.0).sqrt()).abs() < 1e-12, "{error}");
        assert!(slope(&[(1.0, 1.0)]).0.is_nan());
    }
}
