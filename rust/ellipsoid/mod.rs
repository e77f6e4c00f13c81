//! The ellipsoid on which raw readings of a static triad lie, and the `S`, `b` that it gives (model.md, section 4).
//!
//! `|S a' + b| = |g|` is the quadric `a'ᵀ M a' + 2 mᵀ a' = |g|² - c` with `M = SᵀS`, `m = Sᵀb`, `c = bᵀb`. Readings
//! are centred on their mean and divided by their spread before the linear step.

mod standard;

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3};

use crate::error::{Error, Result};
use crate::sensor_model::Model;
pub use standard::Standardisation;

/// `uᵀ A u + 2 hᵀ u = 1` in standardised readings.
#[derive(Debug, Clone, Copy)]
pub struct Quadric {
    /// Symmetric matrix of the quadratic terms.
    pub a: Matrix3<f64>,
    /// Half the linear coefficients.
    pub h: Vector3<f64>,
}

/// Row of the linear problem, `[x² y² z² 2xy 2xz 2yz 2x 2y 2z]`.
fn row(u: &Vector3<f64>) -> [f64; 9] {
    [
        u.x * u.x,
        u.y * u.y,
        u.z * u.z,
        2.0 * u.x * u.y,
        2.0 * u.x * u.z,
        2.0 * u.y * u.z,
        2.0 * u.x,
        2.0 * u.y,
        2.0 * u.z,
    ]
}

fn quadric(x: &[f64]) -> Quadric {
    Quadric {
        a: Matrix3::new(x[0], x[3], x[4], x[3], x[1], x[5], x[4], x[5], x[2]),
        h: Vector3::new(x[6], x[7], x[8]),
    }
}

impl Quadric {
    /// The model of this ellipsoid: `κ = |g|²/(1 + hᵀA⁻¹h)`, `M = κA`, `m = κh`, then `M = SᵀS` and `b = S⁻ᵀm`.
    ///
    /// `None` when the quadric is not an ellipsoid.
    #[must_use]
    pub fn model(&self, gravity: f64) -> Option<Model> {
        let inverse = self.a.cholesky()?.inverse();
        let kappa = gravity * gravity / (1.0 + self.h.dot(&(inverse * self.h)));
        let s = reversed_cholesky(&(self.a * kappa))?;
        let b = s.transpose().try_inverse()? * (self.h * kappa);
        Some(Model { s, b })
    }
}

/// Lower triangular `S` with positive diagonal and `SᵀS = M`: Cholesky from the last corner upwards.
///
/// The ordinary factor `M = L Lᵀ` would give the *upper* triangular `S = Lᵀ`.
#[must_use]
pub fn reversed_cholesky(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let flip = Matrix3::new(0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0);
    let l = (flip * m * flip).cholesky()?.l();
    // (P L P)(P Lᵀ P) = M with P L P upper: its transpose is the lower S of SᵀS = M.
    Some((flip * l * flip).transpose())
}

/// Least squares on the quadric's nine coefficients; the result need not be an ellipsoid.
///
/// # Errors
/// When there are fewer than nine readings or they do not determine nine coefficients.
pub fn fit_quadric(u: &[Vector3<f64>]) -> Result<Quadric> {
    let n = u.len();
    if n < 9 {
        return Err(Error::not_determined(format!(
            "{n} static poses cannot determine the nine parameters of an ellipsoid: record at least nine, better \
             eighteen (six faces and twelve edges of a cube); {}",
            missing_directions(u)
        )));
    }
    let mut h = DMatrix::zeros(n, 9);
    for (i, point) in u.iter().enumerate() {
        h.row_mut(i).copy_from_slice(&row(point));
    }
    let svd = h.svd(true, true);
    if svd.rank(1e-9 * svd.singular_values[0]) < 9 {
        return Err(Error::not_determined(format!(
            "the static poses do not determine an ellipsoid: {}",
            missing_directions(u)
        )));
    }
    svd.solve(&DVector::from_element(n, 1.0), 0.0)
        .map(|x| quadric(x.as_slice()))
        .map_err(Error::not_determined)
}

/// The best quadric among ellipsoids (Li and Griffiths, *Least squares ellipsoid specific fitting*, 2004): minimises
/// the algebraic distance under `4J - I² = 1`, which no hyperboloid satisfies.
///
/// # Errors
/// When there are fewer than nine readings.
pub fn fit_ellipsoid(u: &[Vector3<f64>]) -> Result<Quadric> {
    if u.len() < 9 {
        return fit_quadric(u);
    }
    let mut scatter = SMatrix::<f64, 10, 10>::zeros();
    for point in u {
        let mut extended = [1.0; 10];
        extended[..9].copy_from_slice(&row(point));
        let v = SMatrix::<f64, 10, 1>::from_column_slice(&extended);
        scatter += v * v.transpose();
    }
    scatter /= u.len() as f64;
    let s11 = scatter.fixed_view::<6, 6>(0, 0).into_owned();
    let s12 = scatter.fixed_view::<6, 4>(0, 6).into_owned();
    let s22 = scatter.fixed_view::<4, 4>(6, 6).into_owned();
    let trouble = || {
        Error::not_determined(format!(
            "no ellipsoid fits the static poses: {}",
            missing_directions(u)
        ))
    };
    // A ridge of 1e-12, below any sensor's noise, keeps poses in one plane (and noise-free data) factorisable.
    let ridge4 = SMatrix::<f64, 4, 4>::identity() * 1e-12;
    let back = (s22 + ridge4).cholesky().ok_or_else(trouble)?;
    let reduced = s11 - s12 * back.solve(&s12.transpose())
        + SMatrix::<f64, 6, 6>::identity() * (1e-12 * s11.trace());
    let l_inverse = reduced
        .cholesky()
        .ok_or_else(trouble)?
        .l()
        .try_inverse()
        .ok_or_else(trouble)?;
    // 4J - I² with I = A11+A22+A33, J the sum of the principal 2x2 minors, as a quadratic form.
    let mut constraint = SMatrix::<f64, 6, 6>::identity() * -4.0;
    for i in 0..3 {
        for j in 0..3 {
            constraint[(i, j)] = if i == j { -1.0 } else { 1.0 };
        }
    }
    let eigen = (l_inverse * constraint * l_inverse.transpose()).symmetric_eigen();
    let best = eigen.eigenvalues.imax();
    if eigen.eigenvalues[best] <= 0.0 {
        return Err(trouble());
    }
    let top = l_inverse.transpose() * eigen.eigenvectors.column(best);
    let bottom = -back.solve(&(s12.transpose() * top));
    let constant = -bottom[3];
    if constant == 0.0 {
        return Err(trouble());
    }
    let mut x = [0.0; 9];
    for i in 0..6 {
        x[i] = top[i] / constant;
    }
    for i in 0..3 {
        x[6 + i] = bottom[i] / constant;
    }
    Ok(quadric(&x))
}

/// The sphere through the readings, `|u - centre| = radius`, of smallest `|centre|` where it is not determined: the
/// starting point that needs the fewest readings.
#[must_use]
pub fn fit_sphere(u: &[Vector3<f64>]) -> Option<(Vector3<f64>, f64)> {
    let n = u.len();
    let design = DMatrix::from_fn(n, 4, |i, j| if j < 3 { 2.0 * u[i][j] } else { 1.0 });
    let target = DVector::from_fn(n, |i, _| u[i].norm_squared());
    let svd = design.svd(true, true);
    let x = svd.solve(&target, 1e-6 * svd.singular_values[0]).ok()?;
    let centre = Vector3::new(x[0], x[1], x[2]);
    let squared = x[3] + centre.norm_squared();
    (squared > 0.0).then(|| (centre, squared.sqrt()))
}

/// Names the half axes to which no reading points within 55° (the angle from an axis to the corner of a cube).
#[must_use]
pub fn missing_directions(u: &[Vector3<f64>]) -> String {
    // From the centre of a sphere through them: mean and mid-range shift to where there are more poses.
    let centre = fit_sphere(u).map_or_else(Vector3::zeros, |(centre, _)| centre);
    let mut missing = Vec::new();
    for axis in 0..3 {
        for (sign, word) in [(1.0, "up"), (-1.0, "down")] {
            let seen = u.iter().any(|point| {
                let from_centre = point - centre;
                sign * from_centre[axis] > 0.57 * from_centre.norm()
            });
            if !seen {
                missing.push(format!("{} {word}", ["X", "Y", "Z"][axis]));
            }
        }
    }
    if missing.is_empty() {
        "add poses between the faces: stand the sensor on edges and corners, 45° between two axes"
            .to_owned()
    } else {
        format!("add poses with {}", missing.join(", "))
    }
}
