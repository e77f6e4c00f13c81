//! A session of known numbers, for the tests and the benches of the session model.

use nalgebra::{DVector, Matrix3, Vector3};
use std::f64::consts::PI;
use trihedron::rotation::exp;
use trihedron::session_model::gaps::find_gaps;
use trihedron::session_model::moves::{Move, MoveNoise};
use trihedron::session_model::{Session, State, StaticMeans};

/// A small generator of uniform numbers in (-1, 1): the test must not depend on the simulator.
pub struct Uniform(pub u64);

impl Uniform {
    pub fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.next(), self.next(), self.next())
    }
}

pub const G: f64 = 9.81;

/// A session read without noise by a known instrument, smooth turns of `n` samples between poses, with uneven timestamps
/// and one repeated.
#[must_use]
pub fn made(n_poses: usize, n: usize, scatter: bool) -> (Session, State) {
    let mut random = Uniform(7);
    let step_s = 1.2 / (n - 1) as f64;
    let force_scale = Matrix3::new(0.9, 0.0, 0.0, 0.01, 1.1, 0.0, -0.02, 0.03, 1.05);
    let rate_scale = Matrix3::new(0.01, 1e-4, -2e-4, 0.0, 0.011, 1e-4, 2e-4, 0.0, 0.009);
    let force_bias = Vector3::new(0.1, -0.2, 0.05);
    let zeros: Vec<Vector3<f64>> = (0..n_poses).map(|_| random.vector() * 3.0).collect();
    let mut slow = vec![Vector3::zeros()];
    slow.extend((1..n_poses).map(|_| random.vector() * 0.01));
    let mut up = vec![Vector3::new(0.3, -0.5, 0.8).normalize()];
    let mut moves = Vec::new();
    let mut first_point = 0;
    let pose_time: Vec<f64> = (0..n_poses).map(|i| 5.0 * i as f64).collect();
    let (inverse_force, inverse_rate) = (
        force_scale.try_inverse().unwrap_or_default(),
        rate_scale.try_inverse().unwrap_or_default(),
    );
    for m in 0..n_poses - 1 {
        let axis = random.vector().normalize();
        let mut time: Vec<f64> = (0..n)
            .map(|k| 5.0 * m as f64 + 2.0 + step_s * (k as f64 + 0.1 * random.next()))
            .collect();
        time[n / 2] = time[n / 2 - 1];
        let span = time[n - 1] - time[0];
        let mut rate = Vec::new();
        let mut force = Vec::new();
        for t in &time {
            let x = (t - time[0]) / span;
            let angle = 1.8 * (x - (2.0 * PI * x).sin() / (2.0 * PI));
            let speed = 1.8 / span * (1.0 - (2.0 * PI * x).cos());
            let fraction = (t - pose_time[m]) / (pose_time[m + 1] - pose_time[m]);
            let zero = zeros[m] * (1.0 - fraction) + zeros[m + 1] * fraction;
            let offset = slow[m] * (1.0 - fraction) + slow[m + 1] * fraction;
            rate.push(inverse_rate * (axis * speed) + zero);
            let here = exp(&(-axis * angle)) * up[m] * G;
            force.push(inverse_force * (here - force_bias) + offset);
        }
        up.push(exp(&(-axis * 1.8)) * up[m]);
        let (ends, unresolved) = ([pose_time[m], pose_time[m + 1]], [Vector3::zeros(); 4]);
        moves.push(Move::new(
            m,
            &time,
            rate,
            force,
            ends,
            unresolved,
            first_point,
        ));
        first_point += n;
    }
    find_gaps(&mut moves);
    let noise_force = Vector3::new(1e-3, 1.2e-3, 0.9e-3);
    let noise_rate = Vector3::new(0.02, 0.03, 0.025);
    let at_rest = |mean: Vec<Vector3<f64>>, density: Vector3<f64>| {
        let sigma = vec![density / 2.0; mean.len()];
        StaticMeans::of(mean, sigma, density, None).expect("means without verticals")
    };
    let force_mean = (0..n_poses)
        .map(|i| inverse_force * (up[i] * G - force_bias) + slow[i])
        .collect();
    let session = Session {
        earth_up: 0.0,
        gravity: G,
        time_s: pose_time,
        force: at_rest(force_mean, noise_force),
        rate: Some(at_rest(zeros.clone(), noise_rate)),
        moves: std::sync::Arc::new(moves),
        noise: MoveNoise {
            force_density: noise_force,
            rate_density: noise_rate,
            jitter_s: 0.0,
            nominal_step_s: step_s,
        },
        prior: None,
        scatter: scatter.then_some([noise_force / 2.0, noise_rate / 2.0]),
        expected_scatter: 0.0,
    };
    let state = State {
        force_scale,
        force_bias,
        rate_scale,
        up,
        pose_rate_bias: zeros,
        pose_force_bias: slow,
        own: [(); 2].map(|()| vec![Vector3::zeros(); n_poses]),
        effect: DVector::zeros(0),
    };
    (session, state)
}
