//! Motion in closed form: attitude, rate, angular acceleration and specific force at any set of instants.
//!
//! Within a segment the attitude is `q(t) = q0 · exp(a θ(t)) · exp(u(t))`: a turn about a fixed body axis with a smooth
//! progress, and a rotation vector of windowed harmonics (wobble of a hand, oscillation of a table). The reference
//! point moves along a smooth travel plus windowed harmonics, and the body may turn about a pivot away from it.
//! All derivatives are carried by [`Jet`]s: nothing is integrated and nothing differenced.

use super::jet::{Jet, QuaternionJet, progress, window};
use crate::error::{Error, Result};
use crate::interrupt;
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
    /// Rate given by samples, in place of turn and wobble.
    pub replay: Option<Replay>,
}

/// Rate and acceleration given at evenly spaced knots, straight lines between them.
#[derive(Debug, Clone)]
pub struct Replay {
    /// Rate relative to the level frame, body frame \[rad/s\], at least two knots over the segment's duration.
    rate: Vec<Vector3<f64>>,
    /// Acceleration of the reference point, level frame \[m/s²\].
    acceleration: Vec<Vector3<f64>>,
    /// Attitude at every knot.
    attitude: Vec<[f64; 4]>,
    step: f64,
}

/// Rotation over time `t` by the rate `w + s t`: fourth-order Magnus, `∫ω + t³/12 w×s`.
fn swept(w: &Vector3<f64>, s: &Vector3<f64>, t: f64) -> [f64; 4] {
    let v = w * t + s * (0.5 * t * t) + w.cross(s) * (t * t * t / 12.0);
    let angle = v.norm();
    let k = if angle < 1e-6 {
        0.5 - angle * angle / 48.0
    } else {
        (0.5 * angle).sin() / angle
    };
    [(0.5 * angle).cos(), k * v.x, k * v.y, k * v.z]
}

fn product(p: &[f64; 4], q: &[f64; 4]) -> [f64; 4] {
    let out = [
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    ];
    let norm = out.iter().map(|c| c * c).sum::<f64>().sqrt();
    out.map(|c| c / norm)
}

impl Replay {
    /// Places the knots evenly over a duration, from a start attitude.
    ///
    /// # Errors
    /// Fewer than two knots or lists of different length.
    pub fn new(
        attitude: [f64; 4],
        duration: f64,
        rate: Vec<Vector3<f64>>,
        acceleration: Vec<Vector3<f64>>,
    ) -> Result<Self> {
        if rate.len() < 2 || rate.len() != acceleration.len() {
            return Err(Error::bad_input(format!(
                "a replay needs at least two knots of rate and as many of acceleration, got {} and {}",
                rate.len(),
                acceleration.len()
            )));
        }
        let step = duration / (rate.len() - 1) as f64;
        let mut attitudes = vec![attitude];
        let mut q = attitude;
        for pair in rate.windows(2) {
            q = product(&q, &swept(&pair[0], &((pair[1] - pair[0]) / step), step));
            attitudes.push(q);
        }
        Ok(Self {
            rate,
            acceleration,
            attitude: attitudes,
            step,
        })
    }

    /// Attitude, rate, rate change, and acceleration after `local` seconds.
    fn at(&self, local: f64) -> ([f64; 4], Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        // Truncation is the floor: local is not negative.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let i = ((local / self.step) as usize).min(self.rate.len() - 2);
        let t = local - i as f64 * self.step;
        let slope = (self.rate[i + 1] - self.rate[i]) / self.step;
        let change = (self.acceleration[i + 1] - self.acceleration[i]) / self.step;
        (
            product(&self.attitude[i], &swept(&self.rate[i], &slope, t)),
            self.rate[i] + slope * t,
            slope,
            self.acceleration[i] + change * t,
        )
    }
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

/// Gravity and Earth rate at the place of the motion.
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

/// Motion at many instants, row by row.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// (w, x, y, z) per instant.
    pub attitude: Vec<f64>,
    /// \[rad/s\] per instant.
    pub rate: Vec<f64>,
    /// \[rad/s²\] per instant.
    pub rate_change: Vec<f64>,
    /// \[m/s²\] per instant.
    pub specific_force: Vec<f64>,
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
            && self.replay.is_none()
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
        if let Some(replay) = &self.replay {
            let (attitude, rate, rate_change, acceleration) = replay.at(local);
            let earth = level_to_body(&attitude, &place.earth_rate);
            return State {
                attitude,
                rate: rate + earth,
                rate_change: rate_change - rate.cross(&earth),
                specific_force: level_to_body(&attitude, &(acceleration + up))
                    + rate_change.cross(&self.arm)
                    + rate.cross(&rate.cross(&self.arm)),
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

/// Instants that one worker evaluates in a row.
const CHUNK: usize = 1 << 14;

/// Motion at every instant of `times` (non-decreasing; before the start and after the end the body is static).
///
/// # Errors
/// Segments that are absent, out of order, or malformed; times that run backward.
pub fn evaluate(segments: &[Segment], place: &Place, times: &[f64]) -> Result<Track> {
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
    // A loop rather than `any`: the index of the fault is part of the message.
    for i in 1..times.len() {
        if times[i].is_nan() || times[i] < times[i - 1] {
            return Err(Error::bad_input(format!(
                "times must not run backward: sample {i} is at {} s after {} s",
                times[i],
                times[i - 1]
            )));
        }
    }
    let n = times.len();
    let mut track = Track {
        attitude: vec![0.0; 4 * n],
        rate: vec![0.0; 3 * n],
        rate_change: vec![0.0; 3 * n],
        specific_force: vec![0.0; 3 * n],
    };
    times
        .par_chunks(CHUNK)
        .zip(track.attitude.par_chunks_mut(4 * CHUNK))
        .zip(track.rate.par_chunks_mut(3 * CHUNK))
        .zip(track.rate_change.par_chunks_mut(3 * CHUNK))
        .zip(track.specific_force.par_chunks_mut(3 * CHUNK))
        .for_each(|((((times, q), w), a), f)| {
            if interrupt::is_requested() {
                return;
            }
            let mut k = segments
                .partition_point(|s| s.start <= times[0])
                .saturating_sub(1);
            for (i, &t) in times.iter().enumerate() {
                while k + 1 < segments.len() && segments[k + 1].start <= t {
                    k += 1;
                }
                let state = segments[k].state(t, place);
                q[4 * i..4 * i + 4].copy_from_slice(&state.attitude);
                w[3 * i..3 * i + 3].copy_from_slice(state.rate.as_slice());
                a[3 * i..3 * i + 3].copy_from_slice(state.rate_change.as_slice());
                f[3 * i..3 * i + 3].copy_from_slice(state.specific_force.as_slice());
            }
        });
    Ok(track)
}
