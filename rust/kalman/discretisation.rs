//! Exact discretisation of `x' = F x + w`, `E w wᵀ = Qc δ`: Van Loan's matrix exponential, then doubling.

use nalgebra::DMatrix;

/// `(Φ, Q)` over a step: `Φ = e^{F t}`, `Q = ∫₀ᵗ e^{F s} Qc e^{Fᵀ s} ds`.
///
/// Van Loan (IEEE TAC 23, 1978) reads both from one exponential, whose upper left block `e^{−F t}` overflows once
/// `β t` reaches a few hundred (a fast Gauss-Markov term and a long pause). So the exponential is taken over
/// `t / 2^k`, where `‖F‖ t / 2^k < 1`, and doubled: `Q ← Φ Q Φᵀ + Q`, `Φ ← Φ Φ`.
#[must_use]
pub fn discretise(f: &DMatrix<f64>, qc: &DMatrix<f64>, step: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let n = f.nrows();
    if step == 0.0 || n == 0 {
        return (DMatrix::identity(n, n), DMatrix::zeros(n, n));
    }
    let size = (f * step)
        .row_iter()
        .map(|r| r.iter().map(|v| v.abs()).sum::<f64>())
        .fold(0.0, f64::max);
    let mut doublings = 0;
    let mut h = step;
    let mut scaled = size;
    while scaled > 1.0 && doublings < 1000 {
        scaled *= 0.5;
        h *= 0.5;
        doublings += 1;
    }
    let mut block = DMatrix::zeros(2 * n, 2 * n);
    block.view_mut((0, 0), (n, n)).copy_from(&(-f * h));
    block.view_mut((0, n), (n, n)).copy_from(&(qc * h));
    block
        .view_mut((n, n), (n, n))
        .copy_from(&(f.transpose() * h));
    let e = block.exp();
    let mut phi = e.view((n, n), (n, n)).transpose();
    let mut q = &phi * e.view((0, n), (n, n));
    for _ in 0..doublings {
        q = &phi * &q * phi.transpose() + &q;
        phi = &phi * &phi;
    }
    // Rounding leaves Q slightly asymmetric.
    let q = (&q + q.transpose()) * 0.5;
    (phi, q)
}
