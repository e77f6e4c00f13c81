//! A tile of steps, divided among the lanes of a vector.

#![expect(
    clippy::inline_always,
    reason = "a loop that is not inlined keeps the features of the baseline"
)]

mod lanes;

use nalgebra::Vector3;

use self::lanes::{attitudes, half_vectors, is_forward, last_products, products, step_quaternions};
use super::{Form, IDENTITY, Quaternion, Samples};
use crate::poisson::{RateModel, StepWeights};
use crate::simd::{FUSED_BASELINE, fma};

const LANES: usize = 16;
const ROWS: usize = 32;
type Row = [f64; LANES];

/// Start of a tile: the rotation since the piece began, and the attitude where the piece began.
#[derive(Clone, Copy)]
pub(super) struct Start {
    pub turned: Quaternion,
    pub start: Quaternion,
}

/// Step `m` of lane `l` is step `l · ROWS + m` of the tile; steps beyond the end have no duration.
#[repr(align(64))]
pub(super) struct Tile {
    time: [Row; ROWS + 1],
    rate: [[Row; 3]; ROWS + 1],
    /// Half rotation vectors in the last three, then the quaternion of the step, then that since the lane's start.
    turn: [[Row; 4]; ROWS],
    written: [[Row; 9]; ROWS],
}

impl Tile {
    /// Steps in a tile.
    pub(super) const STEPS: usize = LANES * ROWS;

    // Of 19 kB, and moved to the heap as it is made: the stack holds it for a moment at most.
    #[allow(clippy::large_stack_arrays)]
    pub(super) fn boxed() -> Box<Self> {
        Box::new(Self {
            time: [[0.0; LANES]; ROWS + 1],
            rate: [[[0.0; LANES]; 3]; ROWS + 1],
            turn: [[[0.0; LANES]; 4]; ROWS],
            written: [[[0.0; LANES]; 9]; ROWS],
        })
    }

    /// The rotation since the piece began, after the steps `first..stop` (at most one tile of them).
    ///
    /// # Errors
    /// The number of a step whose rotation is not finite or whose time runs backward.
    pub(super) fn turn(
        &mut self,
        samples: &Samples<'_>,
        first: usize,
        stop: usize,
        turned: Quaternion,
    ) -> Result<Quaternion, usize> {
        self.fill(samples, first, stop)?;
        let mut ends = [[0.0; LANES]; 4];
        last_products(samples.instructions, &self.turn, &mut ends);
        let whole = (0..LANES).fold(turned, |q, l| product(q, ends.map(|row| row[l])));
        Ok(unit(whole))
    }

    /// Writes the attitude after each step; returns what [`turn`](Self::turn) returns.
    pub(super) fn write(
        &mut self,
        samples: &Samples<'_>,
        first: usize,
        stop: usize,
        at: Start,
        form: Form,
        out: &mut [f64],
    ) -> Result<Quaternion, usize> {
        self.fill(samples, first, stop)?;
        products(samples.instructions, &mut self.turn);
        let mut starts = [[0.0; LANES]; 4];
        let mut turned = at.turned;
        for l in 0..LANES {
            let start = product(at.start, turned);
            for c in 0..4 {
                starts[c][l] = start[c];
            }
            turned = product(turned, self.turn[ROWS - 1].map(|row| row[l]));
        }
        attitudes(
            samples.instructions,
            &self.turn,
            &starts,
            form == Form::Matrix,
            &mut self.written,
        );
        let n = (stop - first).min(Self::STEPS);
        match form {
            Form::Matrix => self.copy::<9>(n, out),
            Form::Quaternion => self.copy::<4>(n, out),
            Form::Vector => {
                let (out, _) = out.as_chunks_mut::<3>();
                for (k, out) in out[..n].iter_mut().enumerate() {
                    let row = &self.written[k % ROWS];
                    *out = vector([0, 1, 2, 3].map(|c| row[c][k / ROWS]));
                }
            }
        }
        Ok(unit(turned))
    }

    fn copy<const WIDTH: usize>(&self, n: usize, out: &mut [f64]) {
        let (out, _) = out.as_chunks_mut::<WIDTH>();
        for (l, out) in out[..n].chunks_mut(ROWS).enumerate() {
            for (row, out) in self.written.iter().zip(out) {
                for c in 0..WIDTH {
                    out[c] = row[c][l];
                }
            }
        }
    }

    /// Quaternions of the steps.
    fn fill(&mut self, samples: &Samples<'_>, first: usize, stop: usize) -> Result<(), usize> {
        self.gather(samples, first, stop);
        let is_plain = match samples.model {
            RateModel::Coning => {
                self.half_vectors_of_cubics(samples, first, stop);
                is_forward(samples.instructions, &self.time)
            }
            model => half_vectors(
                samples.instructions,
                &self.time,
                &self.rate,
                model == RateModel::Linear,
                &mut self.turn,
            ),
        };
        let is_short = step_quaternions(samples.instructions, &mut self.turn);
        if is_plain && is_short {
            return Ok(());
        }
        self.fill_slowly(samples, first, stop)
    }

    fn gather(&mut self, samples: &Samples<'_>, first: usize, stop: usize) {
        let (time_s, rate) = (samples.time_s, samples.rate);
        for l in 0..LANES {
            let at = first + l * ROWS;
            if at + ROWS <= stop {
                let (time_s, rate) = (&time_s[at..=at + ROWS], &rate[at..=at + ROWS]);
                for m in 0..=ROWS {
                    self.time[m][l] = time_s[m];
                    for c in 0..3 {
                        self.rate[m][c][l] = rate[m][c];
                    }
                }
            } else {
                for m in 0..=ROWS {
                    let k = (at + m).min(stop);
                    self.time[m][l] = time_s[k];
                    for c in 0..3 {
                        self.rate[m][c][l] = rate[k][c];
                    }
                }
            }
        }
    }

    fn half_vectors_of_cubics(&mut self, samples: &Samples<'_>, first: usize, stop: usize) {
        for k in 0..Self::STEPS {
            let (l, m) = (k / ROWS, k % ROWS);
            let half = if first + k < stop {
                0.5 * rotation_vector(samples, first + k)
            } else {
                Vector3::zeros()
            };
            for c in 0..3 {
                self.turn[m][c + 1][l] = half[c];
            }
        }
    }

    /// Quaternions of steps of any length, one by one.
    fn fill_slowly(
        &mut self,
        samples: &Samples<'_>,
        first: usize,
        stop: usize,
    ) -> Result<(), usize> {
        for k in 0..Self::STEPS {
            let (l, m, step) = (k / ROWS, k % ROWS, first + k);
            let q = if step < stop {
                let v = rotation_vector(samples, step);
                let angle = v.norm();
                let is_forward = samples.time_s[step + 1] >= samples.time_s[step];
                if !(angle.is_finite() && is_forward) {
                    return Err(step);
                }
                let (sin, cos) = (0.5 * angle).sin_cos();
                let v = v * if angle > 0.0 { sin / angle } else { 0.5 };
                [cos, v.x, v.y, v.z]
            } else {
                IDENTITY
            };
            for c in 0..4 {
                self.turn[m][c][l] = q[c];
            }
        }
        Ok(())
    }
}

fn rotation_vector(samples: &Samples<'_>, step: usize) -> Vector3<f64> {
    let n = samples.time_s.len();
    let weights = StepWeights::at(samples.time_s, |k| k, n, step, samples.model);
    let (zeroth, first) = weights.moments(|k| Vector3::from(samples.rate[k]));
    zeroth + zeroth.cross(&first)
}

/// `p q`: first `q`, then `p`.
#[inline(always)]
fn multiply<const FUSED: bool>(p: Quaternion, q: Quaternion) -> Quaternion {
    let ([a, b, c, d], [w, x, y, z]) = (p, q);
    [
        fma::<FUSED>(a, w, -fma::<FUSED>(b, x, fma::<FUSED>(c, y, d * z))),
        fma::<FUSED>(a, x, fma::<FUSED>(b, w, fma::<FUSED>(c, z, -(d * y)))),
        fma::<FUSED>(a, y, fma::<FUSED>(c, w, fma::<FUSED>(d, x, -(b * z)))),
        fma::<FUSED>(a, z, fma::<FUSED>(d, w, fma::<FUSED>(b, y, -(c * x)))),
    ]
}

pub(super) fn product(p: Quaternion, q: Quaternion) -> Quaternion {
    multiply::<FUSED_BASELINE>(p, q)
}

fn unit(q: Quaternion) -> Quaternion {
    let scale = 1.0 / q.iter().map(|c| c * c).sum::<f64>().sqrt();
    q.map(|c| c * scale)
}

/// Rotation vector of `x y z w`, its angle in `[0, π]`.
fn vector([x, y, z, w]: [f64; 4]) -> [f64; 3] {
    let n = (x * x + y * y + z * z).sqrt();
    let scale = if n > 1e-8 {
        2.0 * n.atan2(w.abs()) / n
    } else {
        2.0
    };
    [x, y, z].map(|c| c * scale.copysign(w))
}

pub(super) fn write_one(form: Form, [w, x, y, z]: Quaternion, out: &mut [f64]) {
    match form {
        Form::Matrix => out.copy_from_slice(&matrix::<FUSED_BASELINE>([w, x, y, z])),
        Form::Quaternion => out.copy_from_slice(&[x, y, z, w]),
        Form::Vector => out.copy_from_slice(&vector([x, y, z, w])),
    }
}

#[inline(always)]
fn matrix<const FUSED: bool>([w, x, y, z]: Quaternion) -> [f64; 9] {
    let (x2, y2, z2) = (x + x, y + y, z + z);
    let (xy, xz, yz) = (x * y2, x * z2, y * z2);
    [
        1.0 - fma::<FUSED>(y, y2, z * z2),
        fma::<FUSED>(-w, z2, xy),
        fma::<FUSED>(w, y2, xz),
        fma::<FUSED>(w, z2, xy),
        1.0 - fma::<FUSED>(x, x2, z * z2),
        fma::<FUSED>(-w, x2, yz),
        fma::<FUSED>(-w, y2, xz),
        fma::<FUSED>(w, x2, yz),
        1.0 - fma::<FUSED>(x, x2, y * y2),
    ]
}
