//! Baselines: least squares, recursive and batch, ordinary and generalised with the filter's own noise covariance.

use nalgebra::{DMatrix, DVector};

use super::axis::{N_CONSTANTS, Pose};
use super::shaping::ShapingModel;
use super::ud::{Factors, UdFilter};
use crate::error::{Error, Result};

/// Estimates after every pose, with standard errors by the method's own assumptions.
#[derive(Debug, Clone)]
pub struct Recursion {
    /// `(kx, ky, kz, U0)` after each pose.
    pub constants: Vec<[f64; N_CONSTANTS]>,
    /// Standard errors by these assumptions.
    pub sigma: Vec<[f64; N_CONSTANTS]>,
}

/// One batch solution.
#[derive(Debug, Clone)]
pub struct Batch {
    /// `(kx, ky, kz, U0)`.
    pub constants: [f64; N_CONSTANTS],
    /// Covariance under the coloured noise model (for ordinary least squares: the sandwich formula).
    pub covariance: DMatrix<f64>,
}

fn row(pose: &Pose) -> [f64; N_CONSTANTS] {
    let [x, y, z] = pose.reference;
    [x, y, z, 1.0]
}

fn recurse<'a>(
    rows: impl Iterator<Item = (&'a [f64], f64, f64)>,
    mean: &[f64; N_CONSTANTS],
    sigma: &[f64; N_CONSTANTS],
) -> Recursion {
    let mut filter = UdFilter::new(mean.to_vec(), Factors::diagonal(&sigma.map(|s| s * s)));
    let mut out = Recursion {
        constants: Vec::new(),
        sigma: Vec::new(),
    };
    for (h, z, r) in rows {
        filter.update(h, z, r);
        out.constants.push(std::array::from_fn(|i| filter.x[i]));
        out.sigma
            .push(std::array::from_fn(|i| filter.factors.variance(i).sqrt()));
    }
    out
}

/// Recursive ordinary least squares: every pose has the same white variance `r`.
#[must_use]
pub fn recursive(
    poses: &[Pose],
    r: f64,
    mean: &[f64; N_CONSTANTS],
    sigma: &[f64; N_CONSTANTS],
) -> Recursion {
    let rows: Vec<_> = poses.iter().map(row).collect();
    recurse(
        rows.iter()
            .zip(poses)
            .map(|(h, p)| (h.as_slice(), p.reading, r)),
        mean,
        sigma,
    )
}

/// Covariance of the readings of all poses under the noise model, entry by entry from the continuous system.
///
/// # Errors
/// When the noise is malformed or the poses are out of order.
pub fn noise_covariance(model: &ShapingModel, poses: &[Pose]) -> Result<DMatrix<f64>> {
    let shaping = model.system()?;
    let n = poses.len();
    let k = shaping.layout().n();
    let mut c = DMatrix::zeros(n, n);
    let mut p = shaping.start();
    let mut end: Option<f64> = None;
    // Row i of `seen`: covariance of reading i with the noise states now.
    let mut seen = DMatrix::zeros(n, k);
    let mut h = DVector::zeros(k);
    for (i, pose) in poses.iter().enumerate() {
        let gap = end.map_or(0.0, |e| pose.start - e);
        if gap < -1e-6 * pose.pose_s {
            return Err(Error::bad_input(format!(
                "pose {} is earlier than the one before it",
                i + 1
            )));
        }
        let (phi, q) = shaping.step(gap.max(0.0), pose.pose_s);
        p = &phi * p * phi.transpose() + q;
        shaping.measurement_row(pose.pose_s, h.as_mut_slice());
        let moved = seen.rows(0, i) * phi.transpose();
        seen.rows_mut(0, i).copy_from(&moved);
        let with_now = seen.rows(0, i) * &h;
        for j in 0..i {
            c[(i, j)] = with_now[j];
            c[(j, i)] = with_now[j];
        }
        let mine = &p * &h;
        c[(i, i)] = h.dot(&mine) + model.white_variance(pose.pose_s) + pose.extra_variance;
        seen.row_mut(i).copy_from(&mine.transpose());
        end = Some(pose.start + pose.pose_s);
    }
    Ok(c)
}

fn design(poses: &[Pose]) -> (DMatrix<f64>, DVector<f64>) {
    let h = DMatrix::from_fn(poses.len(), N_CONSTANTS, |i, j| row(&poses[i])[j]);
    let z = DVector::from_iterator(poses.len(), poses.iter().map(|p| p.reading));
    (h, z)
}

/// `(X, y) → ((XᵀX)⁻¹, (XᵀX)⁻¹Xᵀ y)` by QR with the columns scaled to unit length.
fn solve(x: &DMatrix<f64>, y: &DVector<f64>) -> Result<(DMatrix<f64>, DVector<f64>)> {
    let unseen = || {
        Error::not_determined(
            "these poses do not determine the four constants: add poses that turn each axis towards the vertical, \
             both ways up",
        )
    };
    let scale: Vec<f64> = x.column_iter().map(|c| c.norm()).collect();
    if x.nrows() < N_CONSTANTS || scale.iter().any(|s| *s < 1e-9) {
        return Err(unseen());
    }
    let scaled = DMatrix::from_fn(x.nrows(), x.ncols(), |i, j| x[(i, j)] / scale[j]);
    let qr = scaled.qr();
    let r = qr.r();
    if r.diagonal().iter().any(|d| d.abs() < 1e-9) {
        return Err(unseen());
    }
    let inverse = r.try_inverse().ok_or_else(unseen)?;
    let solution = &inverse * (qr.q().transpose() * y);
    let covariance = &inverse * inverse.transpose();
    Ok((
        DMatrix::from_fn(N_CONSTANTS, N_CONSTANTS, |i, j| {
            covariance[(i, j)] / (scale[i] * scale[j])
        }),
        DVector::from_fn(N_CONSTANTS, |i, _| solution[i] / scale[i]),
    ))
}

fn batch(constants: &DVector<f64>, covariance: DMatrix<f64>) -> Batch {
    Batch {
        constants: std::array::from_fn(|i| constants[i]),
        covariance,
    }
}

/// Ordinary batch least squares, with its covariance under the coloured noise.
///
/// # Errors
/// When the poses do not determine the constants.
pub fn ordinary(poses: &[Pose], noise: &DMatrix<f64>) -> Result<Batch> {
    let (h, z) = design(poses);
    let (gram, x) = solve(&h, &z)?;
    let half = &gram * h.transpose();
    Ok(batch(&x, &half * noise * half.transpose()))
}

/// Generalised least squares with the noise covariance: batch solution, and the solution after each pose.
///
/// The lower Cholesky factor whitens causally (row `k` uses readings up to `k` only), so recursive least squares on the
/// whitened rows is generalised least squares on every prefix.
///
/// # Errors
/// When the covariance is not positive definite or the poses do not determine the constants.
pub fn generalised(
    poses: &[Pose],
    noise: DMatrix<f64>,
    mean: &[f64; N_CONSTANTS],
    sigma: &[f64; N_CONSTANTS],
) -> Result<(Batch, Recursion)> {
    let (mut h, mut z) = design(poses);
    let factor = noise.cholesky().ok_or_else(|| {
        Error::bad_input("the noise covariance of the poses is not positive definite: add white noise to the model")
    })?;
    let l = factor.l();
    if !(l.solve_lower_triangular_mut(&mut h) && l.solve_lower_triangular_mut(&mut z)) {
        return Err(Error::bad_input(
            "the noise covariance of the poses is singular",
        ));
    }
    let (covariance, x) = solve(&h, &z)?;
    let rows: Vec<Vec<f64>> = h.row_iter().map(|r| r.iter().copied().collect()).collect();
    let recursion = recurse(
        rows.iter()
            .zip(z.iter())
            .map(|(h, z)| (h.as_slice(), *z, 1.0)),
        mean,
        sigma,
    );
    Ok((batch(&x, covariance), recursion))
}
