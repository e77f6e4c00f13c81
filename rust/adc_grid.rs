//! Resolution (LSB) of an ADC, from the gaps between the distinct values of its readings.

/// Difference, relative to the largest value, below which two values are equal: rounding error of a unit conversion.
const ARITHMETIC: f64 = 1e-9;
/// Gap, in steps, below which two values are one code whose last digit was written in two ways.
const WRITTEN: f64 = 0.02;
/// Largest sum of such gaps, in steps per larger gap; above it the values are codes of their own.
const MOST_WRITTEN: f64 = 0.05;
/// Quantiles of the gaps that are tried as the step, coarse before fine: most neighbours are one step apart where all
/// codes occur; the smallest gap is two spellings of one code where readings were written as text.
const QUANTILES: [f64; 8] = [0.9, 0.75, 0.5, 0.25, 0.1, 0.05, 0.01, 0.0];
/// Distance from a whole number of steps, in steps, up to which a gap counts as whole: a third of a step in all for
/// text with three digits to a step (rounding by half a digit at either end), and a margin. 36 % of continuous gaps do.
const OFF_GRID: f64 = 0.18;
/// Share of the gaps that must be whole.
const ON_GRID: f64 = 0.95;
/// Longest gap tested, in steps: beyond it the error of the step times their number reaches a whole step.
const REACH: f64 = 20.0;
/// Number of neighbouring levels in the densest window, where the refinement of the step begins.
const DENSE: usize = 32;
/// Factor between ranges of the refinement: the step from one range is accurate enough for the next.
const WIDER: f64 = 4.0;
/// Fewest gaps within reach for a test by themselves: all of them are whole by chance in one of 0.36⁻⁷ = 1300 logs.
pub const TESTABLE: usize = 8;
/// With fewer gaps the allowed distance is reduced until chance has this probability, unless all gaps are one step.
const BY_CHANCE: f64 = 1e-3;
/// Readings per distinct value that fewer gaps require.
pub const REPEATS: usize = 2;
/// Largest relative difference between the step from all gaps and the gap tried; above it the gap was not the step.
const DRIFT: f64 = 0.3;
/// Gaps that are tested, evenly spaced where there are more.
const MOST_GAPS: usize = 4096;

/// The step (LSB) of the grid on which `levels` (ascending, distinct) of `n` readings lie; `None` without a grid.
#[must_use]
pub fn step(levels: &[f64], n: usize) -> Option<f64> {
    let (&lowest, &highest) = (levels.first()?, levels.last()?);
    let least = ARITHMETIC * lowest.abs().max(highest.abs());
    let gaps = levels.windows(2).map(|pair| pair[1] - pair[0]);
    let gaps: Vec<f64> = gaps.filter(|&gap| gap > least).collect();
    if gaps.is_empty() || (gaps.len() < TESTABLE && n < REPEATS * levels.len()) {
        return None;
    }
    let thin = gaps.len().div_ceil(MOST_GAPS);
    let gaps: Vec<f64> = gaps.into_iter().step_by(thin).collect();
    let found = tried(&gaps)
        .into_iter()
        .find_map(|near| spacing(&gaps, near))?;
    let found = refined(levels, found);
    // Integer counts have an integer step.
    let is_counts = found > 0.5 && levels.iter().all(|v| v.fract().to_bits() << 1 == 0);
    Some(if is_counts {
        found.round_ties_even()
    } else {
        found
    })
}

/// Candidate steps: quantiles of the gaps, and the smallest remainder by the smallest gap (gaps of 2 and 3 steps: 1).
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a place among the gaps"
)]
fn tried(gaps: &[f64]) -> Vec<f64> {
    let mut ordered = gaps.to_vec();
    ordered.sort_unstable_by(f64::total_cmp);
    let last = (ordered.len() - 1) as f64;
    let mut out = QUANTILES
        .map(|at| ordered[(at * last).round_ties_even() as usize])
        .to_vec();
    out.dedup();
    let least = ordered[0];
    let left = gaps
        .iter()
        .map(|gap| (gap - least * nearest(gap / least)).abs())
        .filter(|&left| left > OFF_GRID * least)
        .fold(f64::INFINITY, f64::min);
    if left.is_finite() {
        out.push(left);
    }
    out
}

/// 1.5 · 2⁵²: adding and subtracting it rounds a number below 2⁵¹ to the nearest integer, ties to even.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// The nearest integer; `round_ties_even` is a library call where the target lacks SSE 4.1.
fn nearest(value: f64) -> f64 {
    (value + WHOLE) - WHOLE
}

/// The step by least squares over all levels: rounding of digits matters less the further apart two levels are.
fn refined(levels: &[f64], mut step: f64) -> f64 {
    let wide = DENSE.min(levels.len() - 1);
    let spans = levels.windows(wide + 1).map(|few| few[wide] - few[0]);
    let densest = spans.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
    let middle = levels[densest.map_or(0, |(at, _)| at) + wide / 2];
    let widest = levels[levels.len() - 1] - levels[0];
    let mut reach = REACH;
    loop {
        let first = levels.partition_point(|v| middle - v > reach * step);
        let last = levels.partition_point(|v| v - middle <= reach * step);
        let near = levels[first..last].iter().map(|v| v - middle);
        let place = |v: f64| nearest(v / step);
        let n = (last - first) as f64;
        let on = near
            .clone()
            .filter(|&v| (v / step - place(v)).abs() < OFF_GRID)
            .count();
        if on as f64 / n < ON_GRID {
            return step; // beyond this reach the error of the step adds up to a step
        }
        let mean = near.clone().map(place).sum::<f64>() / n;
        let (squares, product) = near.fold((0.0, 0.0), |(squares, product), v| {
            let off = place(v) - mean;
            (squares + off * off, product + off * v)
        });
        if squares > 0.0 {
            step = product / squares;
        }
        if reach * step > widest {
            return step;
        }
        reach *= WIDER;
    }
}

/// The step close to `near` of which the gaps are whole multiples; `None` where too few are.
fn spacing(gaps: &[f64], near: f64) -> Option<f64> {
    let (apart, written): (Vec<f64>, Vec<f64>) =
        gaps.iter().partition(|&&gap| gap > WRITTEN * near);
    if written.iter().sum::<f64>() > MOST_WRITTEN * near * apart.len() as f64 {
        return None;
    }
    let mut step = near;
    for reach in [1.0, 3.0, REACH, REACH] {
        let (mut length, mut steps) = (0.0, 0.0);
        for &gap in &apart {
            let whole = nearest(gap / step);
            if (1.0..=reach).contains(&whole) {
                length += gap;
                steps += whole;
            }
        }
        if steps > 0.0 {
            // Rounding of written digits has opposite signs in neighbouring gaps and cancels in the sum.
            step = length / steps;
        }
    }
    let places = apart.iter().map(|gap| gap / step);
    let places: Vec<f64> = places.filter(|&place| place < REACH + 0.5).collect();
    let n = places.len();
    if n < TESTABLE.min(apart.len()) || (step / near - 1.0).abs() > DRIFT {
        return None;
    }
    let is_one_apart = places.iter().all(|place| (place - 1.0).abs() < 0.5);
    let few = if n >= TESTABLE || is_one_apart {
        OFF_GRID
    } else {
        OFF_GRID.min(0.5 * BY_CHANCE.powf(1.0 / (n as f64 - 1.0)))
    };
    let is_on = |place: &&f64| {
        let whole = nearest(**place);
        (*place - whole).abs() < few && whole > 0.0
    };
    let on = places.iter().filter(is_on).count();
    (n > 0 && on as f64 / n as f64 >= ON_GRID).then_some(step)
}
