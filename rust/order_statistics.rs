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

#[cfg(test)]
mod tests {
    use super::{column_medians, median, quantile};

    #[test]
    fn a_median_of_an_even_number_is_the_middle_of_two() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]).to_bits(), 2.0_f64.to_bits());
        assert_eq!(median(&mut [4.0, 1.0]).to_bits(), 2.5_f64.to_bits());
        assert!(median(&mut []).is_nan() && quantile(&mut [], 0.5).is_nan());
    }

    #[test]
    fn a_quantile_lies_between_its_neighbours() {
        let values = [5.0, 1.0, 3.0];
        for (at, wanted) in [
            (0.0, 1.0),
            (0.25, 2.0),
            (0.5, 3.0),
            (0.875, 4.5),
            (1.0, 5.0),
        ] {
            let found: f64 = quantile(&mut values.clone(), at);
            assert_eq!(found.to_bits(), f64::to_bits(wanted), "at {at}");
        }
    }

    #[test]
    fn a_column_with_a_missing_value_has_no_median() {
        let found = column_medians(&[1.0, f64::NAN, 3.0, 2.0], 2);
        assert!((found[0] - 2.0).abs() < 1e-15 && found[1].is_nan());
    }
}
