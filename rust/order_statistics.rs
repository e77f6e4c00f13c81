//! Medians and quantiles, equal to those of `NumPy` to the last bit.

/// Median, the mean of the middle two of an even number; reorders the values. NaN of none.
pub fn median(values: &mut [f64]) -> f64 {
    let n = values.len();
    if n == 0 {
        return f64::NAN;
    }
    let (below, &mut upper, _) = values.select_nth_unstable_by(n / 2, f64::total_cmp);
    if n % 2 == 1 {
        return upper;
    }
    let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    f64::midpoint(lower, upper)
}

/// Quantile `at` (0 to 1), linear between neighbours; reorders the values. NaN of none.
pub fn quantile(values: &mut [f64], at: f64) -> f64 {
    let n = values.len();
    if n == 0 || at.is_nan() {
        return f64::NAN;
    }
    let place = at.clamp(0.0, 1.0) * (n - 1) as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a place among the values"
    )]
    let rank = place.floor() as usize;
    let (_, &mut lower, above) = values.select_nth_unstable_by(rank, f64::total_cmp);
    let share = place - rank as f64;
    let upper = above.iter().copied().fold(f64::INFINITY, f64::min);
    if above.is_empty() || share == 0.0 {
        return lower;
    }
    // From the nearer of the two, so that both ends are exact.
    if share < 0.5 {
        lower + (upper - lower) * share
    } else {
        upper - (upper - lower) * (1.0 - share)
    }
}

/// Median of each column of rows of `width`; NaN where the column holds one.
#[must_use]
pub fn column_medians(rows: &[f64], width: usize) -> Vec<f64> {
    of_columns(rows, width, median)
}

/// `(quantiles, width)` quantiles of each column; NaN where the column holds one.
#[must_use]
pub fn column_quantiles(rows: &[f64], width: usize, at: &[f64]) -> Vec<f64> {
    let of_one = |&at: &f64| of_columns(rows, width, |column: &mut [f64]| quantile(column, at));
    at.iter().flat_map(of_one).collect()
}

fn of_columns(rows: &[f64], width: usize, statistic: impl Fn(&mut [f64]) -> f64) -> Vec<f64> {
    let mut column: Vec<f64> = Vec::with_capacity(rows.len() / width.max(1));
    (0..width)
        .map(|c| {
            column.clear();
            column.extend(rows.iter().skip(c).step_by(width));
            if column.iter().any(|value: &f64| value.is_nan()) {
                f64::NAN
            } else {
                statistic(&mut column)
            }
        })
        .collect()
}
