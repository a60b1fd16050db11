//! Fréchet distance between two sets of feature vectors (Heusel et al. 2017; Dowson and Landau 1982).

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::QualityError;

/// Mean and covariance of feature vectors.
#[derive(Debug, Clone, PartialEq)]
pub struct Gaussian {
    /// Mean feature vector.
    pub mean: DVector<f64>,
    /// Covariance of the features, with n − 1 in the denominator.
    pub covariance: DMatrix<f64>,
}

impl Gaussian {
    /// Mean and covariance of `features`, which holds one vector per image.
    ///
    /// # Errors
    /// There are fewer than two vectors; or vectors are empty, have different lengths, or hold non-finite values.
    pub fn of(features: &[Vec<f64>]) -> Result<Self, QualityError> {
        let (mean, centred) = centred(features)?;
        let covariance = centred.tr_mul(&centred) / (features.len() - 1) as f64;
        Ok(Self { mean, covariance })
    }
}

/// Fréchet distance |μ₁ − μ₂|² + tr(Σ₁ + Σ₂ − 2·(Σ₁Σ₂)^½), never below 0.
///
/// tr (Σ₁Σ₂)^½ is the sum of the singular values of Σ₁^½·Σ₂^½. The roots come from symmetric eigen-decompositions;
/// negative eigenvalues are rounding errors and set to 0. Nothing is inverted, so singular covariances are valid.
///
/// # Errors
/// The dimensions differ, values are not finite, or values are so large that the distance is not finite.
pub fn frechet_distance(a: &Gaussian, b: &Gaussian) -> Result<f64, QualityError> {
    let dimension = a.mean.len();
    for g in [a, b] {
        let lengths = [g.mean.len(), g.covariance.nrows(), g.covariance.ncols()];
        if let Some(&found) = lengths.iter().find(|&&n| n != dimension || n == 0) {
            return Err(QualityError::FeatureLength { found, expected: dimension });
        }
        if let Some(index) = g.mean.iter().chain(g.covariance.iter()).position(|v| !v.is_finite()) {
            return Err(QualityError::NotFinite { index: index % dimension });
        }
    }
    let roots = root(&a.covariance) * root(&b.covariance);
    let cross: f64 = roots.singular_values().iter().sum();
    distance(&a.mean, &b.mean, a.covariance.trace() + b.covariance.trace(), cross)
}

/// Does what [`frechet_distance`] does, for two sets of feature vectors. It is faster if there are fewer vectors than
/// dimensions. Then tr (Σ₁Σ₂)^½ is the sum of the singular values of X₁·X₂ᵀ over √((n₁ − 1)(n₂ − 1)), where the rows
/// of X are the centred vectors.
///
/// # Errors
/// Errors of [`Gaussian::of`]; or the lengths of the vectors differ between the sets, or the distance is not finite.
pub fn frechet_distance_of(a: &[Vec<f64>], b: &[Vec<f64>]) -> Result<f64, QualityError> {
    let ((mean_a, rows_a), (mean_b, rows_b)) = (centred(a)?, centred(b)?);
    let (expected, found) = (mean_a.len(), mean_b.len());
    if expected != found {
        return Err(QualityError::FeatureLength { found, expected });
    }
    if a.len().max(b.len()) >= expected {
        return frechet_distance(&Gaussian::of(a)?, &Gaussian::of(b)?);
    }
    let [free_a, free_b] = [a, b].map(|set| (set.len() - 1) as f64);
    let products = &rows_a * rows_b.transpose();
    let cross = products.singular_values().iter().sum::<f64>() / (free_a * free_b).sqrt();
    let traces = rows_a.norm_squared() / free_a + rows_b.norm_squared() / free_b;
    distance(&mean_a, &mean_b, traces, cross)
}

fn distance(mean_a: &DVector<f64>, mean_b: &DVector<f64>, traces: f64, cross: f64) -> Result<f64, QualityError> {
    let distance = (mean_a - mean_b).norm_squared() + traces - 2.0 * cross;
    // `max` would turn NaN into 0.
    if distance.is_finite() { Ok(distance.max(0.0)) } else { Err(QualityError::NoDistance) }
}

/// Mean of the vectors, and the vectors minus their mean as rows [n × d].
fn centred(features: &[Vec<f64>]) -> Result<(DVector<f64>, DMatrix<f64>), QualityError> {
    let [first, _, ..] = features else { return Err(QualityError::FewFeatures { found: features.len() }) };
    let expected = first.len();
    for vector in features {
        if vector.len() != expected || vector.is_empty() {
            return Err(QualityError::FeatureLength { found: vector.len(), expected: expected.max(1) });
        }
        if let Some(index) = vector.iter().position(|v| !v.is_finite()) {
            return Err(QualityError::NotFinite { index });
        }
    }
    let mut rows = DMatrix::from_fn(features.len(), expected, |row, column| features[row][column]);
    let mean = rows.row_mean();
    rows.row_iter_mut().for_each(|mut row| row -= &mean);
    Ok((mean.transpose(), rows))
}

/// Symmetric square root of a positive semi-definite matrix.
fn root(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(covariance.clone());
    let mut scaled = eigenvectors.clone();
    for (mut column, value) in scaled.column_iter_mut().zip(eigenvalues.iter()) {
        column *= value.max(0.0).sqrt();
    }
    scaled * eigenvectors.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn diagonal(mean: &[f64], variances: &[f64]) -> Gaussian {
        let covariance = DMatrix::from_diagonal(&DVector::from_column_slice(variances));
        Gaussian { mean: DVector::from_column_slice(mean), covariance }
    }

    #[test]
    fn diagonal_ones_have_a_closed_form() {
        let a = diagonal(&[1.0, 2.0, 3.0], &[4.0, 9.0, 0.0]);
        let b = diagonal(&[1.0, 0.0, 3.5], &[1.0, 16.0, 0.25]);
        // Σ (Δμ)² + (σ₁ − σ₂)²
        let expected = 4.0 + 0.25 + 1.0 + 1.0 + 0.25;
        assert!((frechet_distance(&a, &b).unwrap() - expected).abs() < 1e-12);
        assert_eq!(frechet_distance(&a, &a).unwrap(), 0.0);
    }

    #[test]
    fn singular_covariances_survive() {
        let zero = diagonal(&[0.0, 0.0], &[0.0, 0.0]);
        let one = diagonal(&[3.0, 4.0], &[2.0, 0.0]);
        assert!((frechet_distance(&zero, &one).unwrap() - 27.0).abs() < 1e-12);
        let constant = vec![vec![5.0; 40]; 3];
        assert_eq!(frechet_distance_of(&constant, &constant).unwrap(), 0.0);
        // Vectors of rank 1 in 40 dimensions: all on one line.
        let line = |scale: f64| -> Vec<Vec<f64>> { (0..4).map(|i| vec![scale * f64::from(i); 40]).collect() };
        let sigma = |scale: f64| scale * (40.0f64 * 5.0 / 3.0).sqrt();
        let expected = 40.0 * 1.5f64.powi(2) + (sigma(2.0) - sigma(1.0)).powi(2);
        let found = frechet_distance_of(&line(1.0), &line(2.0)).unwrap();
        assert!((found - expected).abs() < 1e-9 * expected, "{found} {expected}");
    }

    #[test]
    fn both_ways_agree() {
        let noise = |seed: u32, n: u32| -> Vec<Vec<f64>> {
            let value = |i: u32| f64::from((i ^ seed).wrapping_mul(2_654_435_761) >> 8) / 2f64.powi(24);
            (0..n).map(|row| (0..12).map(|column| value(row * 12 + column)).collect()).collect()
        };
        let (a, b) = (noise(1, 7), noise(77, 9));
        let short = frechet_distance_of(&a, &b).unwrap();
        let long = frechet_distance(&Gaussian::of(&a).unwrap(), &Gaussian::of(&b).unwrap()).unwrap();
        assert!((short - long).abs() < 1e-7 * long, "{short} {long}");
    }

    #[test]
    fn vectors_that_make_no_distribution_are_an_error() {
        assert_eq!(Gaussian::of(&[vec![1.0]]), Err(QualityError::FewFeatures { found: 1 }));
        let ragged = Gaussian::of(&[vec![1.0], vec![1.0, 2.0]]);
        assert_eq!(ragged, Err(QualityError::FeatureLength { found: 2, expected: 1 }));
        assert!(Gaussian::of(&[vec![], vec![]]).is_err());
        let nan = Gaussian::of(&[vec![1.0, 1.0], vec![1.0, f64::NAN]]);
        assert_eq!(nan, Err(QualityError::NotFinite { index: 1 }));
        let (one, two) = (diagonal(&[0.0], &[1.0]), diagonal(&[0.0; 2], &[1.0; 2]));
        assert!(frechet_distance(&one, &two).is_err());
        assert!(frechet_distance_of(&[vec![0.0], vec![1.0]], &[vec![0.0; 2], vec![1.0; 2]]).is_err());
    }

    #[test]
    fn a_distance_beyond_all_numbers_is_an_error() {
        let far = diagonal(&[1e200], &[1.0]);
        assert_eq!(frechet_distance(&far, &diagonal(&[-1e200], &[1.0])), Err(QualityError::NoDistance));
    }
}
