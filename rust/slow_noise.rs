//! Noise slower than the samples, by the means of the parts of static poses (docs/diagnosis-method.md, 8.2b;
//! docs/model-session.md, 11.12d).

use std::f64::consts::LN_2;

use crate::chi_square::normal_upper;
use crate::order_statistics::{column_medians, column_quantiles, median, quantile};
use crate::ranges::means_by_owner;

type Row = [f64; 3];
type Range = [usize; 2];

/// Quantile over the poses of the change between halves: slow noise is in all poses alike, a bias that jumps only in
/// some.
const QUIET: f64 = 0.3;
/// Largest ratio of the colour of all poses to that of the quiet ones, whose quantile is good to a factor of two.
const MAY_EXCEED: f64 = 2.5;
/// Parts of a pose whose bend shows its slow noise, and the readings that each has at least.
const QUARTERS: usize = 4;
const FEWEST_OF_QUARTER: usize = 3;
/// Parts of a pose: neighbouring ones differ by white noise, its halves by white noise and flicker.
const PARTS: usize = 8;
const FEWEST_OF_PART: usize = 4;
/// Standard errors beyond which a change is a disturbance by hand, not noise.
const CLEAR: f64 = 3.0;

/// Differences of the means of `n` neighbouring parts of every range, `n - 1` of each.
#[must_use]
pub fn steps(readings: &[Row], ranges: &[Range], n: usize) -> Vec<Row> {
    let split = |&[a, b]: &Range| (0..=n).map(move |k| a + (b - a) * k / n);
    let edges: Vec<usize> = ranges.iter().flat_map(split).collect();
    let parts: Vec<Range> = edges
        .chunks_exact(n + 1)
        .flat_map(|own| own.windows(2).map(|ends| [ends[0], ends[1]]))
        .collect();
    let owner: Vec<usize> = (0..parts.len()).collect();
    let (means, _) = means_by_owner(readings, &parts, &owner, parts.len());
    let pairs = means.chunks_exact(n).flat_map(|own| own.windows(2));
    pairs
        .map(|pair| std::array::from_fn(|c| pair[1][c] - pair[0][c]))
        .collect()
}

/// Every value over the other's.
fn over(values: &[Row], others: &[Row]) -> Vec<f64> {
    let pairs = values.as_flattened().iter().zip(others.as_flattened());
    pairs.map(|(value, other)| value / other).collect()
}

/// Quantile of the changes of a standard normal variate that is the difference of two halves of a mean.
fn usual_change() -> f64 {
    2.0 * normal_upper(0.5 - 0.5 * QUIET)
}

/// Variance `(moves)` that slow noise adds to the integral over every move, which lasts `moves_last` s, beyond that of
/// white noise of `density`.
///
/// The integral of white noise over T has the variance N²T. Pose means show flicker and walk: where a mean over τ has
/// c² times the white variance, c²N² replaces N² as long as T is of the order of τ. `sigma` are the standard errors of
/// the means over the `poses`, estimated without assuming white noise. Without it most healthy sessions of parts with
/// flicker (0.2 mg, 20 °/h) disagree.
#[must_use]
pub fn coloured_variance(
    readings: &[Row],
    (poses, sigma): (&[Range], &[Row]),
    density: Row,
    step_s: f64,
    moves_last: &[f64],
) -> Vec<Row> {
    let root = |&[a, b]: &Range| ((b - a) as f64 * step_s).sqrt();
    let white: Vec<Row> = poses
        .iter()
        .map(|pose| density.map(|of| of / root(pose)))
        .collect();
    let changes: Vec<f64> = over(&steps(readings, poses, 2), &white)
        .iter()
        .map(|change| change.abs())
        .collect();
    let square: Vec<f64> = over(sigma, &white).iter().map(|one| one * one).collect();
    let (quiet, pooled) = (
        column_quantiles(&changes, 3, &[QUIET]),
        column_medians(&square, 3),
    );
    let excess: Row = std::array::from_fn(|c| {
        let most = MAY_EXCEED * (quiet[c] / usual_change()).powi(2);
        (pooled[c].min(most).max(1.0) - 1.0) * density[c] * density[c]
    });
    moves_last
        .iter()
        .map(|lasts| excess.map(|of| of * lasts))
        .collect()
}

/// Standard errors of the means over `poses`: those by white noise alone, `white`, with the slow noise that the quiet
/// poses have: a motion is larger in some. At least that of all axes together: a quantile of few poses is uncertain, and
/// noise below a filter's corner exceeds that of the samples on all axes alike.
///
/// Quarters show it by their bend, which has the error of a change between halves: where every support yields no pose is
/// quiet, but a motion that decays is mostly a slope.
#[must_use]
pub fn quiet_errors(readings: &[Row], poses: &[Range], white: &[Row]) -> Vec<Row> {
    let is_long = |[a, b]: &Range| b.saturating_sub(*a) >= FEWEST_OF_QUARTER * QUARTERS;
    let long = poses.iter().zip(white).filter(|(pose, _)| is_long(pose));
    let (long, white_long): (Vec<Range>, Vec<Row>) = long.unzip();
    if long.is_empty() {
        return white.to_vec();
    }
    let steps = steps(readings, &long, QUARTERS);
    let bends: Vec<Row> = steps
        .chunks_exact(QUARTERS - 1)
        .map(|own| std::array::from_fn(|c| 0.5 * (own[2][c] - own[0][c])))
        .collect();
    let mut changes: Vec<f64> = over(&bends, &white_long)
        .iter()
        .map(|change| change.abs())
        .collect();
    let own = column_quantiles(&changes, 3, &[QUIET]);
    let of_all = quantile(&mut changes, QUIET);
    let wider = |row: &Row| {
        std::array::from_fn(|c| row[c] * (own[c].max(of_all) / usual_change()).max(1.0))
    };
    white.iter().map(wider).collect()
}

/// Standard deviation of a pose's bias about that of the session by flicker alone, along the verticals `up`, or, of a
/// gyro, whose bias shows along all axes, their rms; 0 with fewer usable poses than `fewest`.
///
/// Means of neighbouring parts of length t differ by a variance 2N²/t + 4 ln 2 h for white noise N² and a flicker of
/// one-sided density h/f. Below the frequencies that a pose of length T sees, down to those of a session of length L, lies
/// a variance h ln(L/2T). It is 0 where white noise explains the differences of halves. Verticals that are not known are
/// NaN.
#[must_use]
pub fn flicker_scatter(
    readings: &[Row],
    poses: &[Range],
    up: Option<&[Row]>,
    fewest: usize,
) -> f64 {
    let is_usable = |i: &usize| {
        let [a, b] = poses[*i];
        b - a >= PARTS * FEWEST_OF_PART && up.is_none_or(|up| up[*i].iter().all(|v| v.is_finite()))
    };
    let usable: Vec<usize> = (0..poses.len()).filter(is_usable).collect();
    if usable.len() < fewest {
        return 0.0;
    }
    let spans: Vec<Range> = usable.iter().map(|&i| poses[i]).collect();
    let along = |n: usize| -> Vec<Vec<f64>> {
        let changes = steps(readings, &spans, n);
        let part = |(k, row): (usize, &Row)| match up {
            None => row.to_vec(),
            Some(up) => vec![dot(row, &up[usable[k / (n - 1)]])],
        };
        let parts: Vec<Vec<f64>> = changes.iter().enumerate().map(part).collect();
        let column = |c: usize| parts.iter().map(move |row| row[c]).collect();
        (0..parts[0].len()).map(column).collect()
    };
    let square_of = |columns: Vec<Vec<f64>>| -> Vec<f64> {
        columns.iter().map(|column| mean_square(column)).collect()
    };
    let halves = square_of(along(2));
    // Variance of the differences of halves if the noise of the parts is white.
    let white: Vec<f64> = square_of(along(PARTS))
        .iter()
        .map(|square| square * 2.0 / PARTS as f64)
        .collect();
    if !white.iter().all(|&square| square > 0.0) {
        return 0.0; // readings are missing, or constant
    }
    let n = halves.len() as f64;
    let ratios = halves.iter().zip(&white).map(|(half, white)| half / white);
    let excess = ratios.sum::<f64>() / n - 1.0;
    // One standard error: it only widens uncertainties.
    if excess.is_nan() || excess <= (2.0 / (n * spans.len() as f64)).sqrt() {
        return 0.0;
    }
    let level = excess * white.iter().sum::<f64>() / n / (4.0 * LN_2 * (1.0 - 2.0 / PARTS as f64));
    let mut lasts: Vec<f64> = spans.iter().map(|[a, b]| (b - a) as f64).collect();
    let ends = || spans.as_flattened().iter().copied();
    let whole = ends().max().unwrap_or(0) - ends().min().unwrap_or(0);
    let octaves = whole as f64 / (2.0 * median(&mut lasts));
    (level * octaves.ln().max(0.0)).sqrt()
}

fn dot(one: &Row, other: &Row) -> f64 {
    one.iter().zip(other).map(|(a, b)| a * b).sum()
}

/// Mean square of changes without those by hand.
fn mean_square(changes: &[f64]) -> f64 {
    let squares: Vec<f64> = changes.iter().map(|change| change * change).collect();
    let most = CLEAR.powi(2) * median(&mut squares.clone()) / normal_upper(0.25).powi(2);
    let near: Vec<f64> = squares.into_iter().filter(|&one| one <= most).collect();
    near.iter().sum::<f64>() / near.len() as f64
}
