//! Alignment of gyros to gravity: recovery, agreement with closed forms, the banded factor.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use trihedron::banded::Banded;
use trihedron::gyro_alignment::{Alignment, Link, Model, Pose, Settings, fit, tangent_plane};
use trihedron::poisson::{MoveRange, RateModel, RateNoise, prepare_all};
use trihedron::rotation::exp;

fn scale() -> Matrix3<f64> {
    Matrix3::new(1.03, 0.01, -0.02, 0.015, 0.97, 0.01, -0.01, 0.02, 1.01)
}

/// Noise-free moves: smooth turns by rotation vectors, then a rest.
fn session(turns: &[Vector3<f64>], start: Vector3<f64>) -> Alignment {
    let inverse = scale().try_inverse().expect("a regular matrix");
    let (steps, h) = (200, 0.01);
    let (mut time, mut raw, mut ranges) = (Vec::new(), Vec::new(), Vec::new());
    let mut force = start;
    let pose = |force: Vector3<f64>| Pose {
        reading: force,
        var_reading: Vector3::repeat(1e-6),
        bias: Vector3::zeros(),
        var_bias: Vector3::repeat(1e-10),
    };
    let mut poses = vec![pose(force)];
    for turn in turns {
        let first = raw.len();
        for k in 0..=steps {
            let u = f64::from(k) / f64::from(steps);
            // Rate of a raised-cosine turn about a fixed axis.
            let rate = turn * ((1.0 - (std::f64::consts::TAU * u).cos()) / (f64::from(steps) * h));
            time.push(raw.len() as f64 * h);
            raw.push(inverse * rate);
        }
        ranges.push(MoveRange {
            start: first,
            stop: raw.len(),
            anchor_before_s: first as f64 * h - 1.0,
            anchor_after_s: raw.len() as f64 * h + 1.0,
        });
        force = exp(&-turn) * force;
        poses.push(pose(force));
    }
    let links = (0..turns.len())
        .map(|i| Link {
            before: i,
            after: i + 1,
        })
        .collect();
    Alignment {
        poses,
        links,
        moves: prepare_all(&time, &raw, None, &ranges, RateModel::Coning).expect("valid moves"),
        used: vec![true; turns.len()],
        gravity: 9.8,
        noise: RateNoise {
            density: Vector3::repeat(1e-4),
            sigma_time_s: 0.0,
            nominal_step_s: h,
        },
        var_bias_walk: Vector3::zeros(),
        accelerometer_basis: DMatrix::zeros(12, 0),
        is_accelerometer_given: true,
        is_offset_free: false,
        offset_white: DMatrix::zeros(0, 3),
    }
}

fn start(scale: Matrix3<f64>) -> Model {
    Model {
        accelerometer_scale: Matrix3::identity(),
        accelerometer_bias: Vector3::zeros(),
        gyroscope_scale: scale,
        rate_offset: Vector3::zeros(),
        followed: DVector::zeros(0),
    }
}

fn many_turns() -> Vec<Vector3<f64>> {
    (0..12)
        .map(|k| {
            let k = f64::from(k);
            Vector3::new(
                (1.3 * k).sin(),
                (2.1 * k + 1.0).cos(),
                (0.7 * k + 2.0).sin(),
            ) * 1.6
        })
        .collect()
}

#[test]
fn noise_free_moves_return_the_scale_to_rounding() {
    let problem = session(&many_turns(), Vector3::new(1.0, 2.0, 9.5).normalize() * 9.8);
    for from in [Matrix3::identity(), Matrix3::identity() * 0.8] {
        let found = fit(&problem, &[start(from)], &Settings::default()).expect("a fit");
        assert!(found.is_converged, "{}", found.stopped_because);
        // A raised cosine of 200 samples is integrated to 1e-12; the solver stops at steps of 1e-10.
        assert!((found.model.gyroscope_scale - scale()).norm() < 1e-9);
        assert_eq!(found.certainty.rank, 9);
    }
}

#[test]
fn the_tangent_plane_is_across_the_direction() {
    for v in [
        Vector3::x(),
        Vector3::new(1.0, 1.0, 1.0),
        Vector3::new(-1e-9, 0.0, 9.8),
    ] {
        let t = tangent_plane(&v);
        assert!((t.transpose() * v).norm() < 1e-14 * v.norm());
        assert!((t.transpose() * t - nalgebra::Matrix2::identity()).norm() < 1e-14);
    }
}

#[test]
fn the_banded_factor_whitens_as_the_dense_one() {
    let (n, width) = (14, 3);
    let root = DMatrix::from_fn(n, n, |i, j| {
        if i >= j && i - j <= width {
            (1.0 + (i * 7 + j * 3) as f64).sin() + if i == j { 3.0 } else { 0.0 }
        } else {
            0.0
        }
    });
    let dense = &root * root.transpose();
    let mut banded = Banded::zeros(n, width);
    for i in 0..n {
        for j in i.saturating_sub(width)..=i {
            banded.add(i, j, dense[(i, j)]);
        }
    }
    let mut seen = DMatrix::from_fn(n, 2, |i, j| (i + 5 * j) as f64);
    let expected = dense
        .clone()
        .cholesky()
        .expect("positive")
        .l()
        .solve_lower_triangular(&seen)
        .expect("regular");
    banded.cholesky().expect("positive").whiten(&mut seen);
    // A well-conditioned factor of 14 rows: some ulp.
    assert!((seen - expected).norm() < 1e-12);
    assert!(Banded::zeros(3, 1).cholesky().is_err());
}
