//! Chi-square and normal probabilities for any real number of degrees of freedom; with [`beta`] the F, Student's t and
//! binomial ones.

pub mod beta;

use beta::falling_root;

/// `ln Γ(x)` for `x > 0` (Lanczos, g = 7, nine terms: relative error below 1e-14).
#[must_use]
pub fn ln_gamma(x: f64) -> f64 {
    const COEFFICIENTS: [f64; 9] = [
        0.999_999_999_999_809_9,
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];
    if x < 0.5 {
        return (std::f64::consts::PI / (std::f64::consts::PI * x).sin()).ln() - ln_gamma(1.0 - x);
    }
    let x = x - 1.0;
    let t = x + 7.5;
    let series: f64 = COEFFICIENTS
        .iter()
        .skip(1)
        .zip(1_u32..)
        .fold(COEFFICIENTS[0], |sum, (c, i)| sum + c / (x + f64::from(i)));
    0.5 * (2.0 * std::f64::consts::PI).ln() + (x + 0.5) * t.ln() - t + series.ln()
}

/// Median of a squared standard normal.
pub const MEDIAN_SQUARE: f64 = 0.454_936_423_119_572_7;

/// Probabilities that a chi-square variate of `dof` degrees of freedom stays below `value`, and above it.
///
/// The smaller one is computed directly: neither loses precision.
#[must_use]
pub fn chi_square_tails(value: f64, dof: f64) -> (f64, f64) {
    if !(value > 0.0 && dof > 0.0) {
        return if value > 0.0 {
            (f64::NAN, f64::NAN)
        } else {
            (0.0, 1.0)
        };
    }
    let (a, x) = (0.5 * dof, 0.5 * value);
    if a > 1e5 {
        // Wilson-Hilferty: the cube root is normal to better than 1e-6 of a sigma here.
        let z = ((x / a).cbrt() - (1.0 - 1.0 / (9.0 * a))) * (9.0 * a).sqrt();
        return (normal_above(-z), normal_above(z));
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut k) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-17 {
            k += 1.0;
            term *= x / k;
            sum += term;
        }
        let below = front * sum;
        return (below, 1.0 - below);
    }
    // Lentz' continued fraction.
    let mut b = x + 1.0 - a;
    let mut c = 1e300;
    let mut d = 1.0 / b;
    let mut h = d;
    for i in 1..100_000 {
        let i = f64::from(i);
        let an = -i * (i - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-16 {
            break;
        }
    }
    let above = front * h;
    (1.0 - above, above)
}

/// Probability that a standard normal variate exceeds `z`.
#[must_use]
pub fn normal_above(z: f64) -> f64 {
    let half = 0.5
        * if z.abs() < 1e-8 {
            1.0
        } else {
            chi_square_tails(z * z, 1.0).1
        };
    if z >= 0.0 { half } else { 1.0 - half }
}

/// Value that a chi-square variate of `dof` degrees of freedom exceeds with probability `above`, however small.
#[must_use]
pub fn chi_square_upper(above: f64, dof: f64) -> f64 {
    falling_root(above, |x| chi_square_tails(x, dof).1)
}

/// Value that a standard normal variate exceeds with probability `above`.
#[must_use]
pub fn normal_upper(above: f64) -> f64 {
    if above > 0.5 {
        return -normal_upper(1.0 - above);
    }
    // Its square is chi-square with one degree of freedom.
    chi_square_upper(2.0 * above, 1.0).sqrt()
}
