//! Rows of the processes behind the biases (docs/model-session.md, 11.8).

use nalgebra::{DMatrix, DVector};

use super::chain::{Layout, Rows};
use super::rows::{Domain, Group, Kind};
use super::{N_POSE_SCATTER, Session, State, Strengths};

/// Standard error that keeps the accelerometer's constant bias at zero (it is `b`), in units of its noise of 1 s.
const PINNED: f64 = 1e-3;

/// Processes of scatter: kind, index of the strength, axes.
const OF_FORCE: [(Kind, usize, &[usize]); 1] = [(Kind::ForceScatter, 0, &[0, 1, 2])];
const OF_RATE: [(Kind, usize, &[usize]); 3] = [
    (Kind::RateScatterX, 1, &[0]),
    (Kind::RateScatterY, 2, &[1]),
    (Kind::RateScatterZ, 3, &[2]),
];

impl Session {
    /// (11.8): random walks between poses, and the scatter of each pose.
    pub(super) fn process_rows(
        &self,
        state: &State,
        strengths: &Strengths,
        layout: Layout,
        out: &mut Vec<Group>,
    ) {
        let sensors = [
            (
                Some(&self.force),
                &state.pose_force_bias,
                5,
                Kind::ForceWalk,
            ),
            (self.rate.as_ref(), &state.pose_rate_bias, 2, Kind::RateWalk),
        ];
        for (s, (sensor, bias, column, walk)) in sensors.into_iter().enumerate() {
            let domain = [Domain::StaticForce, Domain::StaticRate][s];
            let Some(sensor) = sensor else {
                pin_missing_gyro(layout, column, out);
                continue;
            };
            let own_column = [11, 8][s];
            let own = &state.own[s];
            if s == 0 {
                // The accelerometer's constant bias is b itself.
                let sigma = sensor.density.amax().max(f64::MIN_POSITIVE) * PINNED;
                let residual = (bias[0] - own[0]) / sigma;
                let mut group = Group::of(
                    DVector::from_column_slice(residual.as_slice()),
                    layout,
                    0,
                    Domain::Prior,
                    Kind::Prior,
                );
                pin(&mut group.rows, column, 1.0 / sigma);
                if layout.pose == N_POSE_SCATTER {
                    pin(&mut group.rows, own_column, -1.0 / sigma);
                }
                out.push(group);
            }
            for i in 0..layout.n_poses - 1 {
                let gap = (self.time_s[i + 1] - self.time_s[i]).max(1e-3);
                // K with N²/τ = K²τ/3 at the corner τ.
                let sigma = sensor.density * (3.0 * gap).sqrt() / strengths.corner_s[s];
                let change = bias[i + 1] - own[i + 1] - bias[i] + own[i];
                let mut group = Group::of(DVector::zeros(3), layout, i, domain, walk);
                group.rows.next = DMatrix::zeros(3, layout.pose);
                for c in 0..3 {
                    let inverse = 1.0 / sigma[c].max(f64::MIN_POSITIVE);
                    group.rows.residual[c] = change[c] * inverse;
                    group.rows.here[(c, column + c)] = -inverse;
                    group.rows.next[(c, column + c)] = inverse;
                    if layout.pose == N_POSE_SCATTER {
                        group.rows.here[(c, own_column + c)] = inverse;
                        group.rows.next[(c, own_column + c)] = -inverse;
                    }
                    group.log_weight += inverse.ln();
                }
                out.push(group);
            }
            let Some(reference) = &self.scatter else {
                continue;
            };
            for (i, share) in own.iter().enumerate() {
                let scatters: &[_] = if s == 0 { &OF_FORCE } else { &OF_RATE };
                for (scatter, strength, axes) in scatters {
                    let mut group =
                        Group::of(DVector::zeros(axes.len()), layout, i, domain, *scatter);
                    for (r, &c) in axes.iter().enumerate() {
                        let inverse = 1.0 / (reference[s][c] * strengths.scatter[*strength]);
                        group.rows.residual[r] = share[c] * inverse;
                        group.rows.here[(r, own_column + c)] = inverse;
                        group.log_weight += inverse.ln();
                    }
                    out.push(group);
                }
            }
        }
    }
}

/// Without a gyro its unknowns are pinned, so that the system stays regular.
fn pin_missing_gyro(layout: Layout, column: usize, out: &mut Vec<Group>) {
    for i in 0..layout.n_poses {
        let mut group = Group::of(DVector::zeros(3), layout, i, Domain::Prior, Kind::Prior);
        pin(&mut group.rows, column, 1.0);
        if layout.pose == N_POSE_SCATTER {
            let mut own = Group::of(DVector::zeros(3), layout, i, Domain::Prior, Kind::Prior);
            pin(&mut own.rows, 8, 1.0);
            out.push(own);
        }
        out.push(group);
    }
}

fn pin(rows: &mut Rows, column: usize, value: f64) {
    for c in 0..3 {
        rows.here[(c, column + c)] = value;
    }
}
