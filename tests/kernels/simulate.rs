//! The simulated instrument against closed forms; its stages: `tests/test_simulate_recovery.py`.

use std::f64::consts::TAU;
use trihedron::simulate::mechanism::Bridge;
use trihedron::simulate::noise::flicker_poles;

#[test]
fn equal_plates_read_two_xi_over_four_minus_xi_squared() {
    for x in [-0.7, -0.1, 0.0, 1e-4, 0.3, 0.9] {
        let exact = 2.0 * x / (4.0 - x * x);
        assert!((Bridge::voltage(x, 0.0) - exact).abs() < 1e-15);
    }
}

#[test]
fn flicker_poles_add_up_to_one_over_f() {
    let (n, dt) = (1_000_000, 0.01);
    let poles = flicker_poles(n, dt);
    let mut f = 1.0 / (n as f64 * dt);
    while f < 0.4 / dt {
        let w = TAU * f;
        // Discrete spectrum of the sampled processes, two-sided.
        let psd: f64 = poles
            .iter()
            .map(|(p, variance)| {
                let keep = (-p * dt).exp();
                variance * dt * (1.0 - keep * keep)
                    / (1.0 - 2.0 * keep * (w * dt).cos() + keep * keep)
            })
            .sum();
        // Ripple 0.3 %; at both ends of the band the sum is cut, at the upper one aliasing nearly makes up for it.
        assert!((psd * w - 1.0).abs() < 0.07, "{f} Hz: {}", psd * w);
        f *= 1.3;
    }
}
