//! Motion in closed form: attitude, rate, angular acceleration and specific force at any set of instants.
//!
//! Within a segment the attitude is `q(t) = q0 · exp(a θ(t)) · exp(u(t))`: a turn about a fixed body axis with a smooth
//! progress, and a rotation vector of windowed harmonics (wobble of a hand, oscillation of a table). The reference
//! point moves along a smooth travel plus windowed harmonics, and the body may turn about a pivot away from it.
//! All derivatives are carried by [`Jet`]s: nothing is integrated and nothing differenced.

use super::jet::{Jet, QuaternionJet, progress, window};
use crate::error::{Error, Result};
use nalgebra::Vector3;
use rayon::prelude::*;

/// One stretch of motion, starting where the last one ended.
#[derive(Debug, Clone)]
pub struct Segment {
    /// Start \[s\].
    pub start: f64,
    /// Duration \[s\], positive.
    pub duration: f64,
    /// Attitude at the start: body to level, (w, x, y, z), unit length.
    pub attitude: [f64; 4],
    /// Unit axis of the turn, body frame.
    pub axis: Vector3<f64>,
    /// Angle of the turn \[rad\].
    pub angle: f64,
    /// Fraction of the duration over which speed rises (and falls), in (0, 0.5].
    pub ramp: f64,
    /// Travel of the pivot, level frame \[m\].
    pub travel: Vector3<f64>,
    /// From the pivot to the body's reference point, body frame \[m\].
    pub arm: Vector3<f64>,
    /// Fraction of the duration over which harmonics are faded in (and out), in (0, 0.5].
    pub fade: f64,
    /// Harmonics of the rotation vector \[rad\].
    pub wobble: Vec<Harmonic>,
    /// Harmonics of the pivot's displacement \[m\], level frame.
    pub shake: Vec<Harmonic>,
}

/// `amplitude · sin(2π frequency (t - start) + phase)`.
#[derive(Debug, Clone)]
pub struct Harmonic {
    /// Amplitude per axis.
    pub amplitude: Vector3<f64>,
    /// Frequency \[Hz\].
    pub frequency: f64,
    /// Phase \[rad\].
    pub phase: f64,
}

/// Where the motion happens.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// Gravity \[m/s²\], along the level frame's -z.
    pub gravity: f64,
    /// Angular velocity of the Earth in the level frame \[rad/s\].
    pub earth_rate: Vector3<f64>,
}

/// Motion at one instant.
#[derive(Debug, Clone, Copy)]
pub struct State {
    /// Body to level, (w, x, y, z).
    pub attitude: [f64; 4],
    /// Angular rate with respect to inertial space, body frame \[rad/s\].
    pub rate: Vector3<f64>,
    /// Derivative of the rate, body frame \[rad/s²\].
    pub rate_change: Vector3<f64>,
    /// Specific force at the reference point, body frame \[m/s²\].
    pub specific_force: Vector3<f64>,
}

/// Rotate by the inverse of a unit quaternion: level to body.
#[must_use]
pub fn level_to_body(q: &[f64; 4], x: &Vector3<f64>) -> Vector3<f64> {
    let v = Vector3::new(-q[1], -q[2], -q[3]);
    let t = v.cross(x) * 2.0;
    x + t * q[0] + v.cross(&t)
}

fn harmonics(list: &[Harmonic], local: f64, w: Jet) -> [Jet; 3] {
    let mut sum = [Jet::default(); 3];
    for h in list {
        let omega = std::f64::consts::TAU * h.frequency;
        let (s, _) = Jet {
            v: omega * local + h.phase,
            d: omega,
            dd: 0.0,
        }
        .sin_cos();
        let term = s * w;
        for k in 0..3 {
            sum[k] = sum[k] + term * h.amplitude[k];
        }
    }
    sum
}

impl Segment {
    fn is_still(&self) -> bool {
        self.angle == 0.0
            && self.travel == Vector3::zeros()
            && self.wobble.is_empty()
            && self.shake.is_empty()
    }

    /// Motion at `time`, which is clamped to the segment.
    #[must_use]
    pub fn state(&self, time: f64, place: &Place) -> State {
        let up = Vector3::z() * place.gravity;
        let local = (time - self.start).clamp(0.0, self.duration);
        if self.is_still() {
            let earth = level_to_body(&self.attitude, &place.earth_rate);
            return State {
                attitude: self.attitude,
                rate: earth,
                rate_change: Vector3::zeros(),
                specific_force: level_to_body(&self.attitude, &up),
            };
        }
        let tau = Jet {
            v: local / self.duration,
            d: 1.0 / self.duration,
            dd: 0.0,
        };
        let advance = progress(tau, self.ramp);
        let faded = window(tau, self.fade);
        let mut q = QuaternionJet::constant(&self.attitude)
            .times(&QuaternionJet::about(&self.axis, advance * self.angle));
        if !self.wobble.is_empty() {
            q = q.times(&QuaternionJet::exp(&harmonics(&self.wobble, local, faded)));
        }
        let (rate, rate_change) = q.rate_and_acceleration();
        let attitude = q.value();
        let mut velocity = self.travel * advance.d;
        let mut acceleration = self.travel * advance.dd;
        if !self.shake.is_empty() {
            let shake = harmonics(&self.shake, local, faded);
            velocity += Vector3::from(shake.map(|j| j.d));
            acceleration += Vector3::from(shake.map(|j| j.dd));
        }
        // Motion relative to the rotating Earth: Coriolis; the centrifugal part is in gravity.
        let swing = rate.cross(&self.arm);
        let earth = level_to_body(&attitude, &place.earth_rate);
        let velocity_body = level_to_body(&attitude, &velocity) + swing;
        let specific_force = level_to_body(&attitude, &(acceleration + up))
            + rate_change.cross(&self.arm)
            + rate.cross(&swing)
            + earth.cross(&velocity_body) * 2.0;
        State {
            attitude,
            rate: rate + earth,
            // d/dt of the Earth rate seen from the turning body: -ω × Ω.
            rate_change: rate_change - rate.cross(&earth),
            specific_force,
        }
    }
}

/// Motion at every instant of `times` (non-decreasing; before the start and after the end the body rests).
///
/// # Errors
/// Segments that are absent, out of order, or malformed; times that run backward.
pub fn evaluate(segments: &[Segment], place: &Place, times: &[f64]) -> Result<Vec<State>> {
    if segments.is_empty() {
        return Err(Error::bad_input("a motion needs at least one segment"));
    }
    for (k, s) in segments.iter().enumerate() {
        let in_order = k == 0 || s.start >= segments[k - 1].start;
        let finite = s.start.is_finite() && s.duration.is_finite() && s.duration > 0.0;
        let fractions = [s.ramp, s.fade].iter().all(|&r| r > 0.0 && r <= 0.5);
        if !(in_order && finite && fractions) {
            return Err(Error::bad_input(format!(
                "segment {k} of the motion is malformed: starts at {} s, lasts {} s, ramp {}, fade {}",
                s.start, s.duration, s.ramp, s.fade
            )));
        }
    }
    // A loop rather than `any`: the place of the fault is part of the message.
    for i in 1..times.len() {
        if times[i].is_nan() || times[i] < times[i - 1] {
            return Err(Error::bad_input(format!(
                "times must not run backward: sample {i} is at {} s after {} s",
                times[i],
                times[i - 1]
            )));
        }
    }
    let per_chunk = 1 << 14;
    let chunks: Vec<Vec<State>> = times
        .par_chunks(per_chunk)
        .map(|chunk| {
            let mut k = segments
                .partition_point(|s| s.start <= chunk[0])
                .saturating_sub(1);
            chunk
                .iter()
                .map(|&t| {
                    while k + 1 < segments.len() && segments[k + 1].start <= t {
                        k += 1;
                    }
                    segments[k].state(t, place)
                })
                .collect()
        })
        .collect();
    Ok(chunks.into_iter().flatten().collect())
}
