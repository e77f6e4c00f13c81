//! Covariance of the stacked residuals, and the residuals themselves.
//!
//! A move's own part is the noise of its integrated rate and the drift of the bias between the poses; the
//! means of the poses enter every row that used them, so neighbouring moves are correlated:
//!
//! ```text
//! C = Σ_h A_h var(a'_h) A_hᵀ + Σ_h Z_h var(z_h) Z_hᵀ + blockdiag(D C_θ Dᵀ)                  (5.8)
//! ```

use super::{Alignment, Evaluated, Rows, force_wrt_accelerometer, tangent_plane};
use crate::banded::{Banded, BandedCholesky};
use crate::error::Result;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// A noise-free (simulated) record would make the covariance singular: nothing is known better than this part of g.
const FINEST_RELATIVE: f64 = 1e-9;

/// Rows in the order of time, so that the covariance is banded.
pub(super) struct Layout {
    pub rows: Vec<Rows>,
    pub offsets: Vec<usize>,
    pub n: usize,
}

impl Layout {
    pub fn new(problem: &Alignment, at: &Evaluated) -> Self {
        let mut moves_from: Vec<Vec<usize>> = vec![Vec::new(); problem.poses.len()];
        for (index, link) in problem.links.iter().enumerate() {
            if problem.used[index] {
                moves_from[link.before].push(index);
            }
        }
        let mut rows = Vec::new();
        if problem.is_accelerometer_given {
            rows.extend((0..problem.n_accelerometer()).map(Rows::Given));
        }
        rows.extend((0..problem.n_offset_rows()).map(Rows::Offset));
        for (pose, moves) in moves_from.iter().enumerate() {
            if problem.n_accelerometer() > 0 && !problem.is_accelerometer_given {
                rows.push(Rows::Norm(pose));
            }
            for &index in moves {
                let to = at.forces[problem.links[index].after];
                rows.push(Rows::Move(index, tangent_plane(&to).transpose()));
            }
        }
        let mut offsets = Vec::with_capacity(rows.len());
        let mut n = 0;
        for row in &rows {
            offsets.push(n);
            n += row.len();
        }
        Self { rows, offsets, n }
    }

    /// Residuals and their derivative with respect to the free parameters.
    pub fn linearise(&self, problem: &Alignment, at: &Evaluated) -> (DVector<f64>, DMatrix<f64>) {
        let mut residual = DVector::zeros(self.n);
        let mut jacobian = DMatrix::zeros(self.n, problem.n_parameters());
        for (row, &offset) in self.rows.iter().zip(&self.offsets) {
            match row {
                Rows::Given(direction) => {
                    residual[offset] = at.model.followed[*direction];
                    jacobian[(offset, *direction)] = 1.0;
                }
                Rows::Offset(known) => {
                    let white = problem.offset_white.row(*known);
                    residual[offset] = (white * at.model.rate_offset)[0];
                    jacobian
                        .view_mut((offset, problem.n_accelerometer() + 9), (1, 3))
                        .copy_from(&white);
                }
                Rows::Norm(pose) => {
                    let force = at.forces[*pose];
                    residual[offset] = force.norm() - problem.gravity;
                    let wrt = force.normalize().transpose()
                        * force_wrt_accelerometer(&problem.poses[*pose].reading)
                        * &problem.accelerometer_basis;
                    jacobian
                        .view_mut((offset, 0), (1, problem.n_accelerometer()))
                        .copy_from(&wrt);
                }
                Rows::Move(index, plane) => {
                    let one = problem.move_row(at, *index);
                    residual
                        .rows_mut(offset, 2)
                        .copy_from(&(plane * one.residual));
                    jacobian
                        .rows_mut(offset, 2)
                        .copy_from(&(plane * one.jacobian));
                }
            }
        }
        (residual, jacobian)
    }

    /// Factor of C; `weights` below one inflate a move's own block by `1/weight`.
    pub fn covariance(
        &self,
        problem: &Alignment,
        at: &Evaluated,
        weights: &[f64],
    ) -> Result<(BandedCholesky, Vec<f64>)> {
        let sources = self.sources(problem, at);
        let mut width = 2;
        for source in &sources {
            let ends = source.touched.iter().map(|(block, _)| {
                let first = self.offsets[*block];
                (first, first + self.rows[*block].len() - 1)
            });
            let (low, high) = ends.fold((usize::MAX, 0), |(low, high), (a, b)| {
                (low.min(a), high.max(b))
            });
            width = width.max(high.saturating_sub(low));
        }
        let mut c = Banded::zeros(self.n, width);
        for source in &sources {
            let var = Matrix3::from_diagonal(&source.var);
            for (p, (block_p, wrt_p)) in source.touched.iter().enumerate() {
                for (block_q, wrt_q) in &source.touched[..=p] {
                    let product = wrt_p * var * wrt_q.transpose();
                    let (row, column) = (self.offsets[*block_p], self.offsets[*block_q]);
                    add_block(&mut c, row, column, &product);
                }
            }
        }
        let finest = (FINEST_RELATIVE * problem.gravity).powi(2);
        let mut mahalanobis = vec![0.0; problem.links.len()];
        for (row, &offset) in self.rows.iter().zip(&self.offsets) {
            let floor = if matches!(row, Rows::Given(_) | Rows::Offset(_)) {
                1.0
            } else {
                finest
            };
            for i in 0..row.len() {
                c.add(offset + i, offset + i, floor);
            }
            if let Rows::Move(index, plane) = row {
                let own = plane * own_covariance(problem, at, *index) * plane.transpose();
                for i in 0..2 {
                    for j in 0..=i {
                        c.add(offset + i, offset + j, own[(i, j)]);
                    }
                }
                let whole = nalgebra::Matrix2::from_fn(|i, j| c.get(offset + i, offset + j));
                let seen = plane * problem.move_row(at, *index).residual;
                mahalanobis[*index] = whole
                    .try_inverse()
                    .map_or(0.0, |inverse| (seen.transpose() * inverse * seen)[0]);
                let extra = whole * (1.0 / weights[*index] - 1.0);
                for i in 0..2 {
                    for j in 0..=i {
                        c.add(offset + i, offset + j, extra[(i, j)]);
                    }
                }
            }
        }
        Ok((c.cholesky()?, mahalanobis))
    }

    /// The means of every pose and the rows they entered.
    fn sources(&self, problem: &Alignment, at: &Evaluated) -> Vec<Source> {
        let mut readings: Vec<Source> = (0..problem.poses.len())
            .map(|pose| Source {
                var: problem.poses[pose].var_reading,
                touched: Vec::new(),
            })
            .collect();
        let mut biases: Vec<Source> = (0..problem.poses.len())
            .map(|pose| Source {
                var: problem.poses[pose].var_bias,
                touched: Vec::new(),
            })
            .collect();
        let scale = at.model.accelerometer_scale;
        for (block, row) in self.rows.iter().enumerate() {
            match row {
                Rows::Given(_) | Rows::Offset(_) => {}
                Rows::Norm(pose) => readings[*pose].touched.push((
                    block,
                    dynamic(&(at.forces[*pose].normalize().transpose() * scale)),
                )),
                Rows::Move(index, plane) => {
                    let link = problem.links[*index];
                    let turn = &at.turns[*index];
                    let across = plane * problem.move_row(at, *index).wrt_angle;
                    let rate = -at.model.gyroscope_scale;
                    readings[link.before]
                        .touched
                        .push((block, dynamic(&(plane * turn.rotation * scale))));
                    readings[link.after]
                        .touched
                        .push((block, dynamic(&(plane * -scale))));
                    biases[link.before]
                        .touched
                        .push((block, dynamic(&(across * turn.wrt_bias_before * rate))));
                    biases[link.after]
                        .touched
                        .push((block, dynamic(&(across * turn.wrt_bias_after * rate))));
                }
            }
        }
        readings.append(&mut biases);
        readings.retain(|source| !source.touched.is_empty());
        readings
    }
}

/// The mean of one pose, its variance, and the derivative of every block that used it.
struct Source {
    var: Vector3<f64>,
    touched: Vec<(usize, DMatrix<f64>)>,
}

fn dynamic<R: nalgebra::Dim, C: nalgebra::Dim, S: nalgebra::RawStorage<f64, R, C>>(
    matrix: &nalgebra::Matrix<f64, R, C, S>,
) -> DMatrix<f64> {
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)])
}

fn add_block(c: &mut Banded, row: usize, column: usize, block: &DMatrix<f64>) {
    for i in 0..block.nrows() {
        for j in 0..block.ncols() {
            let (p, q) = (row + i, column + j);
            if row == column {
                if p >= q {
                    c.add(p, q, block[(i, j)]);
                }
            } else {
                c.add(p.max(q), p.min(q), block[(i, j)]);
            }
        }
    }
}

/// Covariance of a move's residual from what happens inside the move alone, three components.
pub(super) fn own_covariance(problem: &Alignment, at: &Evaluated, index: usize) -> Matrix3<f64> {
    let turn = &at.turns[index];
    let wrt_angle = problem.move_row(at, index).wrt_angle;
    // A bias that walks freely between the poses leaves the interpolated one, over the move's share Δ of the
    // span T, off by var(∫) = q² Δ² (1/4 − Δ/6T): a Brownian bridge, in which q² is the variance of the whole change.
    let share = (turn.duration_s / problem.moves[index].span_s()).clamp(0.0, 1.0);
    let rate = (turn.wrt_bias_before + turn.wrt_bias_after) * at.model.gyroscope_scale;
    let walk = rate
        * Matrix3::from_diagonal(&problem.var_bias_walk)
        * rate.transpose()
        * (0.25 - share / 6.0);
    wrt_angle * (turn.cov_noise + walk) * wrt_angle.transpose()
}

/// Covariance of a move's residual from every measurement behind it, three components.
pub(super) fn whole_covariance(problem: &Alignment, at: &Evaluated, index: usize) -> Matrix3<f64> {
    let link = problem.links[index];
    let turn = &at.turns[index];
    let (before, after) = (&problem.poses[link.before], &problem.poses[link.after]);
    let scale = at.model.accelerometer_scale;
    let across = problem.move_row(at, index).wrt_angle * -1.0;
    let mut cov = own_covariance(problem, at, index);
    for (wrt, var) in [
        (turn.rotation * scale, before.var_reading),
        (-scale, after.var_reading),
        (
            across * turn.wrt_bias_before * at.model.gyroscope_scale,
            before.var_bias,
        ),
        (
            across * turn.wrt_bias_after * at.model.gyroscope_scale,
            after.var_bias,
        ),
    ] {
        cov += wrt * Matrix3::from_diagonal(&var) * wrt.transpose();
    }
    cov
}
