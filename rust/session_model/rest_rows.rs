//! Rows of the static poses (docs/model-session.md, 11.1, 11.2).

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::chain::Layout;
use super::rows::{Domain, Group, Kind};
use super::{Distortion, N_MODEL, Session, State, StaticMeans, tangent_plane};
use crate::error::{Error, Result};
use crate::sensor_model::LOWER;

impl Session {
    /// (11.1), (11.2): the raw mean less the reading predicted by the model.
    pub(super) fn rest_rows(
        &self,
        state: &State,
        distortion: &Distortion,
        layout: Layout,
        out: &mut Vec<Group>,
    ) -> Result<()> {
        let inverse = state.force_scale.try_inverse().ok_or_else(collapsed)?;
        for i in 0..layout.n_poses {
            let mut asked = state.up[i] * self.gravity - state.force_bias;
            add_effect(
                distortion.force.as_ref(),
                distortion.k,
                i,
                state,
                &mut asked,
            );
            let read = inverse * asked;
            let mut group = at_rest(&self.force, i, &(read + state.pose_force_bias[i]), layout);
            let weight = weight_of(&self.force, i);
            for (c, &(row, column)) in LOWER.iter().enumerate() {
                set(
                    &mut group.rows.border,
                    c,
                    &(inverse.column(row) * read[column]),
                    &weight,
                );
            }
            for c in 0..3 {
                set(
                    &mut group.rows.border,
                    6 + c,
                    &inverse.column(c).into_owned(),
                    &weight,
                );
                set(&mut group.rows.here, 5 + c, &-Vector3::ith(c, 1.0), &weight);
            }
            let tilt = inverse * tangent_plane(&state.up[i]) * self.gravity;
            for c in 0..2 {
                set(&mut group.rows.here, c, &-tilt.column(c), &weight);
            }
            set_effect(
                distortion.force.as_ref(),
                distortion.k,
                i,
                &inverse,
                &weight,
                &mut group,
            );
            group.domain = Domain::StaticForce;
            out.push(group);
        }
        self.rates_at_rest(state, distortion, layout, out)
    }

    /// (11.2).
    fn rates_at_rest(
        &self,
        state: &State,
        distortion: &Distortion,
        layout: Layout,
        out: &mut Vec<Group>,
    ) -> Result<()> {
        let Some(rate) = &self.rate else {
            return Ok(());
        };
        let inverse = state.rate_scale.try_inverse().ok_or_else(collapsed)?;
        for i in 0..layout.n_poses {
            let mut asked = state.up[i] * self.earth_up;
            add_effect(distortion.rate.as_ref(), distortion.k, i, state, &mut asked);
            let read = inverse * asked;
            let mut group = at_rest(rate, i, &(read + state.pose_rate_bias[i]), layout);
            let weight = weight_of(rate, i);
            for row in 0..3 {
                for column in 0..3 {
                    let slope = inverse.column(row) * read[column];
                    set(
                        &mut group.rows.border,
                        9 + 3 * row + column,
                        &slope,
                        &weight,
                    );
                }
                set(
                    &mut group.rows.here,
                    2 + row,
                    &-Vector3::ith(row, 1.0),
                    &weight,
                );
            }
            let tilt = inverse * tangent_plane(&state.up[i]) * self.earth_up;
            for c in 0..2 {
                set(&mut group.rows.here, c, &-tilt.column(c), &weight);
            }
            set_effect(
                distortion.rate.as_ref(),
                distortion.k,
                i,
                &inverse,
                &weight,
                &mut group,
            );
            group.domain = Domain::StaticRate;
            out.push(group);
        }
        Ok(())
    }
}

pub(super) fn collapsed() -> Error {
    Error::not_determined("a sensor's triad has collapsed: its S cannot be inverted")
}

pub(super) fn weight_of(sensor: &StaticMeans, pose: usize) -> Matrix3<f64> {
    sensor.white[pose]
}

fn at_rest(sensor: &StaticMeans, pose: usize, read: &Vector3<f64>, layout: Layout) -> Group {
    let residual = weight_of(sensor, pose) * (sensor.mean[pose] - read);
    Group::of(
        DVector::from_column_slice(residual.as_slice()),
        layout,
        pose,
        Domain::StaticForce,
        Kind::Reading,
    )
}

fn set(matrix: &mut DMatrix<f64>, column: usize, slope: &Vector3<f64>, weight: &Matrix3<f64>) {
    let white = weight * slope;
    for i in 0..3 {
        matrix[(i, column)] = white[i];
    }
}

/// The columns `(3, k)` at a point.
fn row_of(columns: Option<&Vec<f64>>, k: usize, point: usize) -> Option<&[f64]> {
    columns?.get(3 * k * point..3 * k * (point + 1))
}

fn add_effect(
    columns: Option<&Vec<f64>>,
    k: usize,
    point: usize,
    state: &State,
    out: &mut Vector3<f64>,
) {
    if let Some(row) = row_of(columns, k, point) {
        for i in 0..3 {
            out[i] += (0..k)
                .map(|c| row[i * k + c] * state.effect[c])
                .sum::<f64>();
        }
    }
}

pub(super) fn rest_columns(
    columns: Option<&Vec<f64>>,
    k: usize,
    point: usize,
    inverse: &Matrix3<f64>,
    weight: &Matrix3<f64>,
    out: &mut DMatrix<f64>,
) {
    if let Some(row) = row_of(columns, k, point) {
        for c in 0..k {
            let slope = -inverse * Vector3::new(row[c], row[k + c], row[2 * k + c]);
            set(out, c, &slope, weight);
        }
    }
}

fn set_effect(
    columns: Option<&Vec<f64>>,
    k: usize,
    pose: usize,
    inverse: &Matrix3<f64>,
    weight: &Matrix3<f64>,
    group: &mut Group,
) {
    let mut out = DMatrix::zeros(3, k);
    rest_columns(columns, k, pose, inverse, weight, &mut out);
    group.rows.border.columns_mut(N_MODEL, k).copy_from(&out);
}
