//! What dither does to rounding. The filter: `tests/test_kalman.py`.

use trihedron::kalman::rounding::undithered_variance;

#[test]
fn dither_removes_the_rounding_error_from_a_mean() {
    let step = 0.3;
    assert!((undithered_variance(step, 0.0) - step * step / 12.0).abs() < 1e-16);
    assert!(undithered_variance(step, 0.5 * step) < 1e-4 * step * step / 12.0);
    // Direct: the error of the mean of round(x + noise) is the sawtooth convolved with the noise.
    let dither = 0.25 * step;
    let n = 400;
    let mean_error = |x: f64| {
        let cells = 4001;
        let (mut sum, mut weight) = (0.0, 0.0);
        for i in 0..cells {
            let u = (f64::from(i) / f64::from(cells - 1) - 0.5) * 12.0;
            let w = (-0.5 * u * u).exp();
            let v = x + u * dither;
            sum += w * ((v / step).round() * step - v);
            weight += w;
        }
        sum / weight
    };
    let direct: f64 = (0..n)
        .map(|i| mean_error((f64::from(i) + 0.5) / f64::from(n) * step).powi(2))
        .sum::<f64>()
        / f64::from(n);
    // Trapezoid over a sawtooth with 4001 cells: jumps cost 1e-3 of the step.
    assert!((undithered_variance(step, dither) / direct - 1.0).abs() < 0.01);
}
