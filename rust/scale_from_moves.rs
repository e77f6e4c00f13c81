//! The scale of a gyro, axes and signs included, from moves between poses: where a fit of the session begins.

use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, SVector, Vector3};

use crate::order_statistics::median;
use crate::rotation::exp;

/// Fewest moves: a scale has nine elements, and a move determines three at most.
const FEWEST_MOVES: usize = 3;
/// Singular value, relative to the largest, below which moves leave a scale undetermined.
const UNDETERMINED: f64 = 1e-3;
/// Iterations of the weights: they converge in ten.
const ROUNDS: usize = 20;
/// Tilt error, rad, that says nothing of a move yet.
const USUAL_RAD: f64 = 0.03;

/// Readings of moves, the accelerometer's forces `f = S a + b` and the gyro's rates less the move's `bias`.
pub struct Moves<'a> {
    /// Times of the samples, s.
    pub time: &'a [f64],
    /// Readings of the accelerometer.
    pub reading: &'a [Vector3<f64>],
    /// `S` and `b` of the accelerometer.
    pub direct: (Matrix3<f64>, Vector3<f64>),
    /// Readings of the gyro.
    pub rate: &'a [Vector3<f64>],
    /// Samples of every move, half-open.
    pub ranges: &'a [[usize; 2]],
    /// Reading of the gyro at rest, for every move.
    pub bias: &'a [Vector3<f64>],
    /// Forces in the poses before and after every move.
    pub ends: &'a [[Vector3<f64>; 2]],
}

impl Moves<'_> {
    /// The scale `given`, that of the moves in integral form, or the `nominal` one, improved along the paths of the
    /// moves; `None` where there is none of these.
    #[must_use]
    pub fn scale(&self, given: Option<Matrix3<f64>>, nominal: Option<f64>) -> Option<Matrix3<f64>> {
        let of_unit = || nominal.map(|scale| Matrix3::identity() * scale);
        let first = given.or_else(|| self.integral()).or_else(of_unit)?;
        Some(self.along_paths(&first))
    }

    /// The scale by Poisson's equation in integral form, `f_j − f_i = ∫ [f]× S w dt`, which is linear in it once `f`
    /// inside a move is read from the accelerometer; `None` where the moves do not determine it.
    ///
    /// Sign, order of axes and handedness come without a nominal scale; but accelerations of the hand, like any errors
    /// of a regressor, make the scale too small: by half and more where turns are quick.
    fn integral(&self) -> Option<Matrix3<f64>> {
        let told: Vec<_> = self
            .moments()
            .into_iter()
            .zip(self.ends)
            .filter_map(|(moment, ends)| Some((moment?, ends[1] - ends[0])))
            .collect();
        if told.len() < FEWEST_MOVES {
            return None;
        }
        let mut matrix = DMatrix::zeros(3 * told.len(), 9);
        let mut side = DVector::zeros(3 * told.len());
        for (k, (moment, change)) in told.iter().enumerate() {
            matrix.rows_mut(3 * k, 3).copy_from(&by_scale(moment));
            side.rows_mut(3 * k, 3).copy_from(change);
        }
        let sizes: Vec<f64> = matrix.column_iter().map(|column| column.norm()).collect();
        if sizes.contains(&0.0) {
            return None;
        }
        for (mut column, size) in matrix.column_iter_mut().zip(&sizes) {
            column /= *size;
        }
        let svd = matrix.svd(true, true);
        let (least, most) = (svd.singular_values.min(), svd.singular_values.max());
        if least < UNDETERMINED * most {
            return None;
        }
        let found = svd.solve(&side, 0.0).ok()?;
        Some(Matrix3::from_fn(|i, j| found[3 * i + j] / sizes[3 * i + j]))
    }

    /// The scale by that equation with `f` rotated by the gyro from both poses instead of measured, iterated from
    /// `first`; a move that contradicts the others has little weight (Cauchy).
    ///
    /// Unlike Gauss-Newton on the tilt errors it converges from half the scale, after turns by 180° too.
    fn along_paths(&self, first: &Matrix3<f64>) -> Matrix3<f64> {
        let mut lengths: Vec<f64> = self.ends.iter().map(|ends| ends[1].norm()).collect();
        let (g, size) = (median(&mut lengths), first.singular_values().max());
        let mut scale = *first;
        for _ in 0..ROUNDS {
            let moments = self.rotated_moments(&scale);
            let rows = moments.iter().zip(self.ends).map(|(moment, ends)| {
                let row = by_scale(moment) * (size / g);
                let left = (ends[1] - ends[0]) / g - row * in_rows(&(scale / size));
                (row, left)
            });
            let rows: Vec<_> = rows.collect();
            let mut squared: Vec<f64> = rows.iter().map(|(_, left)| left.norm_squared()).collect();
            let usual = median(&mut squared).max(USUAL_RAD * USUAL_RAD);
            // A scale that the moves do not determine stays near the first.
            let mut normal = SMatrix::<f64, 9, 9>::identity();
            let mut side = in_rows(&((first - scale) / size));
            for (row, left) in &rows {
                let weight = 1.0 / (1.0 + left.norm_squared() / usual) / (USUAL_RAD * USUAL_RAD);
                normal += row.tr_mul(row) * weight;
                side += row.tr_mul(left) * weight;
            }
            let Some(half) = normal.cholesky() else { break };
            let step = half.solve(&side);
            scale += Matrix3::from_row_slice(step.as_slice()) * size;
            if step.amax() < USUAL_RAD * USUAL_RAD {
                break;
            }
        }
        scale
    }

    /// `∫ f wᵀ dt` by trapezoids over every move. Rows that are not finite are skipped; `None` where fewer than two remain.
    fn moments(&self) -> Vec<Option<Matrix3<f64>>> {
        let is_number = |v: &Vector3<f64>| v.iter().all(|value| value.is_finite());
        let of_move = |(&[start, stop], bias): (&[usize; 2], &Vector3<f64>)| {
            let mut sum = Matrix3::zeros();
            let (mut before, mut rows): (Option<(f64, Matrix3<f64>)>, usize) = (None, 0);
            for i in start..stop {
                let force = self.direct.0 * self.reading[i] + self.direct.1;
                let rate = self.rate[i] - bias;
                if !(is_number(&force) && is_number(&rate)) {
                    continue;
                }
                let now = (self.time[i], force * rate.transpose());
                if let Some((then, product)) = before {
                    sum += (product + now.1) * (0.5 * (now.0 - then));
                }
                before = Some(now);
                rows += 1;
            }
            (rows > 1).then_some(sum)
        };
        self.ranges.iter().zip(self.bias).map(of_move).collect()
    }

    /// The same of the force `f` at rest before a move (`ends`, first) that the rate of
    /// scale `scale` rotates forwards and of that after it (second) rotated back: at every angle the average of both,
    /// weighted by the angle to the other end. Accelerations have no part in it.
    fn rotated_moments(&self, scale: &Matrix3<f64>) -> Vec<Matrix3<f64>> {
        let of_move = |k: usize| {
            let ([start, stop], bias, ends) = (self.ranges[k], self.bias[k], self.ends[k]);
            let (time, rate) = (self.time, self.rate);
            let finite: Vec<usize> = (start..stop)
                .filter(|&i| rate[i].iter().all(|value| value.is_finite()))
                .collect();
            let steps: Vec<Vector3<f64>> = finite
                .windows(2)
                .map(|pair| {
                    ((rate[pair[0]] + rate[pair[1]]) * 0.5 - bias) * (time[pair[1]] - time[pair[0]])
                })
                .collect();
            let halves: Vec<Matrix3<f64>> = steps
                .iter()
                .map(|step| exp(&(scale * step * 0.5)))
                .collect();
            let whole: f64 = steps.iter().map(|step| (scale * step).norm()).sum();
            // In the middle of every step, from the last to the first.
            let mut force = ends[1];
            let mut back: Vec<Vector3<f64>> = Vec::with_capacity(steps.len());
            for half in halves.iter().rev() {
                back.push(half * force);
                force = half * (half * force);
            }
            let (mut force, mut angle, mut sum) = (ends[0], 0.0, Matrix3::zeros());
            for ((step, half), back) in steps.iter().zip(&halves).zip(back.iter().rev()) {
                let turn = (scale * step).norm();
                let share = (angle + 0.5 * turn) / whole.max(f64::MIN_POSITIVE);
                let forwards = half.tr_mul(&force);
                sum += (forwards * (1.0 - share) + back * share) * step.transpose();
                force = half.tr_mul(&forwards);
                angle += turn;
            }
            sum
        };
        (0..self.ranges.len()).map(of_move).collect()
    }
}

/// Derivative of `∫ [f]× S w dt` by `S` row by row, from `∫ f wᵀ dt`: `∂([f]× S w)/∂S_ij = f × e_i w_j`.
fn by_scale(moment: &Matrix3<f64>) -> SMatrix<f64, 3, 9> {
    SMatrix::from_fn(|row, c| {
        let (i, force) = (c / 3, moment.column(c % 3));
        force.cross(&Matrix3::identity().column(i))[row]
    })
}

fn in_rows(matrix: &Matrix3<f64>) -> SVector<f64, 9> {
    SVector::from_column_slice(matrix.transpose().as_slice())
}
