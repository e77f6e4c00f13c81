//! The incomplete beta function, and from it the F, Student's t and binomial distributions.

use super::ln_gamma;

/// Terms of the continued fraction: their number grows with the square root of the larger parameter.
const MOST_TERMS: u32 = 200_000;

/// Probabilities that a beta variate with parameters `a`, `b` is below `x`, and above it (`y` is `1 - x`, passed as
/// well so that precision is kept near either end).
#[must_use]
pub fn beta_tails(a: f64, b: f64, x: f64, y: f64) -> (f64, f64) {
    if !(a > 0.0 && b > 0.0 && (0.0..=1.0).contains(&x)) {
        return (f64::NAN, f64::NAN);
    }
    if x <= 0.0 {
        return (0.0, 1.0);
    }
    if y <= 0.0 {
        return (1.0, 0.0);
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * y.ln()).exp();
    // The continued fraction converges quickly on the near side of the mean.
    if x < (a + 1.0) / (a + b + 2.0) {
        let below = front * fraction(a, b, x) / a;
        (below, 1.0 - below)
    } else {
        let above = front * fraction(b, a, y) / b;
        (1.0 - above, above)
    }
}

/// Lentz' continued fraction of the incomplete beta function.
fn fraction(a: f64, b: f64, x: f64) -> f64 {
    let held = |v: f64| if v.abs() < 1e-300 { 1e-300 } else { v };
    let mut c = 1.0;
    let mut d = 1.0 / held(1.0 - (a + b) * x / (a + 1.0));
    let mut out = d;
    for m in 1..MOST_TERMS {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        d = 1.0 / held(1.0 + even * d);
        c = held(1.0 + even / c);
        out *= d * c;
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / held(1.0 + odd * d);
        c = held(1.0 + odd / c);
        out *= d * c;
        if (d * c - 1.0).abs() < 1e-16 {
            break;
        }
    }
    out
}

/// Probability that an F variate of `top` and `bottom` degrees of freedom exceeds `value`.
#[must_use]
pub fn f_above(value: f64, top: f64, bottom: f64) -> f64 {
    if value.is_nan() {
        return f64::NAN;
    }
    if value <= 0.0 {
        return 1.0;
    }
    let whole = bottom + top * value;
    beta_tails(0.5 * bottom, 0.5 * top, bottom / whole, top * value / whole).0
}

/// Value that an F variate of `top` and `bottom` degrees of freedom exceeds with probability `above`.
#[must_use]
pub fn f_upper(above: f64, top: f64, bottom: f64) -> f64 {
    falling_root(above, |x| f_above(x, top, bottom))
}

/// Value that a Student variate of `dof` degrees of freedom exceeds with probability `above`.
#[must_use]
pub fn student_upper(above: f64, dof: f64) -> f64 {
    if above > 0.5 {
        return -student_upper(1.0 - above, dof);
    }
    // Its square is an F variate.
    f_upper(2.0 * above, 1.0, dof).sqrt()
}

/// Probability of more than `count` successes in `trials`, each with probability `chance`.
#[must_use]
pub fn binomial_above(count: f64, trials: f64, chance: f64) -> f64 {
    if count < 0.0 {
        return 1.0;
    }
    if count >= trials {
        return 0.0;
    }
    beta_tails(count + 1.0, trials - count, chance, 1.0 - chance).0
}

/// Argument at which a probability that falls from one to zero on `(0, ∞)` equals `wanted`.
pub(super) fn falling_root(wanted: f64, above: impl Fn(f64) -> f64) -> f64 {
    if !(0.0..=1.0).contains(&wanted) || above(1.0).is_nan() {
        return f64::NAN;
    }
    if wanted <= 0.0 {
        return f64::INFINITY;
    }
    let (mut low, mut high) = (1.0, 1.0);
    while above(high) > wanted && high < 1e300 {
        low = high;
        high *= 2.0;
    }
    while above(low) <= wanted && low > 1e-300 {
        high = low;
        low *= 0.5;
    }
    // Bisection: 52 steps reach full precision.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if above(middle) > wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}
