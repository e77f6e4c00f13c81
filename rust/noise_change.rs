//! Noise inside poses that changes for a while: one level in consecutive poses, against one of each pose
//! (docs/diagnosis-method.md, 8.7g).

use std::f64::consts::TAU;

use crate::log_sum::log_sum;
use crate::order_statistics::median;

/// Differences of readings whose variances are compared, and those of white noise of variance one: the second for the
/// level, because motion is slow; the first shows with it whether the spectrum is that of noise.
const DIFFERENCES: [(usize, f64); 2] = [(2, 6.0), (1, 2.0)];
/// Readings for every independent square of second differences of white noise, twice the sum of squared correlations
/// less one.
const SAMPLES_OF_ONE: f64 = 1.94;
/// Standard deviations of the logarithm of a loud pose's variance: common to the axes, and of each axis beside it.
const SPAN: f64 = 2.0;
const OF_AXES: f64 = 1.0;
/// Scatter of that logarithm over usual poses, beyond chance; the likeliest of these.
const SCATTERS: [f64; 7] = [0.0, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0];
/// Shares of poses with a level of their own, evenly spaced; the likeliest of these.
const N_SHARES: usize = 30;
const SHARES: [f64; 2] = [0.01, 0.6];
/// The same while an interval is sought.
const USUAL_SHARE: f64 = 0.1;
/// Largest ratio of the ratios of both variances: a hand or a support that vibrates has most of its power in the first
/// differences.
const SAME_SHAPE: f64 = 1.3;
/// Variance over the usual one from which a change is named, or its inverse: noise of a part changes by a factor of two
/// over a hundred kelvin.
const LEAST_RATIO: f64 = 2.0;
/// Standard errors by which the noise of a move may be below the level.
const CLEAR: f64 = 3.0;

/// A half-open range of rows.
type Range = [usize; 2];
/// Variances by second and first differences, and the readings that they are of.
type Variances = ([[f64; 3]; 2], f64);

/// Noise of one sensor in the poses `first` to `last` over that of the others.
#[derive(Debug, Clone)]
pub struct NoiseChange {
    /// First pose.
    pub first: usize,
    /// Last pose.
    pub last: usize,
    /// Axes that were tested.
    pub axes: Vec<usize>,
    /// Ratio of the standard deviations of each.
    pub ratio: Vec<f64>,
    /// Its standard error.
    pub sigma: Vec<f64>,
    /// Twice the log-likelihood gained, less its penalty.
    pub score: f64,
    /// Share of the excess in the variance of all poses.
    pub share: f64,
}

/// The interval of poses whose noise differs most clearly from that of all others.
///
/// `poses` are the undisturbed parts of each, `moves` with the poses before and after them; axes with less noise than
/// `least` are not dithered, and are left out. `None` below `fewest` poses, and where no change is noise.
#[must_use]
pub fn noise_change(
    readings: &[[f64; 3]],
    least: [f64; 3],
    poses: &[Vec<Range>],
    moves: &[(Range, Range)],
    fewest: usize,
) -> Option<NoiseChange> {
    let seen: Vec<Variances> = poses.iter().map(|own| variances(readings, own)).collect();
    let usable: Vec<usize> = (0..seen.len()).filter(|&i| seen[i].1 > 0.0).collect();
    if usable.len() < fewest {
        return None;
    }
    let of = |order: usize, k: usize| -> Vec<f64> {
        usable.iter().map(|&i| seen[i].0[order][k]).collect()
    };
    let usual = [0, 1].map(|j| [0, 1, 2].map(|k| median(&mut of(j, k))));
    let is_noisy = |k: usize| {
        let is_dithered = usual[1][k] >= least[k].powi(2);
        is_dithered
            && [of(0, k), of(1, k)]
                .concat()
                .iter()
                .all(|&variance| variance > 0.0)
    };
    let axes: Vec<usize> = (0..3).filter(|&k| is_noisy(k)).collect();
    if axes.is_empty() {
        return None;
    }
    let log = |i: usize, j: usize| -> Vec<f64> {
        axes.iter()
            .map(|&k| (seen[i].0[j][k] / usual[j][k]).ln())
            .collect()
    };
    let logs: Vec<Vec<f64>> = usable.iter().map(|&i| log(i, 0)).collect();
    let noise: Vec<f64> = usable
        .iter()
        .map(|&i| 2.0 * SAMPLES_OF_ONE / seen[i].1)
        .collect();
    let (score, [first, stop], level) = interval(&logs, &noise)?;
    let inside = &usable[first..stop];
    let fast: Vec<Vec<f64>> = inside.iter().map(|&i| log(i, 1)).collect();
    let white = |k: usize| usual[0][axes[k]] / usual[1][axes[k]];
    if level.iter().all(|l| l.abs() < LEAST_RATIO.ln())
        || !is_noise(&logs[first..stop], &fast, white)
    {
        return None;
    }
    let (first, last) = (inside[0], inside[inside.len() - 1]);
    let power = |&(range, links): &(Range, Range)| {
        let (variance, n) = variances(readings, &[range]);
        let own: f64 = axes.iter().map(|&k| variance[0][k] / usual[0][k]).sum();
        let is_inside = links.iter().all(|&pose| first <= pose && pose <= last);
        (own / axes.len() as f64, n * axes.len() as f64, is_inside)
    };
    let in_moves: Vec<_> = moves.iter().map(power).collect();
    let agree = moves_agree(&in_moves, mean(level.iter().map(|l| l.exp())))?;
    let readings_of = |which: &[usize]| which.iter().map(|&i| seen[i].1).sum::<f64>();
    let excess = mean(level.iter().map(|l| (l.exp() - 1.0).abs()));
    let share = readings_of(inside) / readings_of(&usable) * excess;
    let spread = 1.0
        / inside
            .iter()
            .map(|&i| seen[i].1 / (2.0 * SAMPLES_OF_ONE))
            .sum::<f64>();
    let ratio: Vec<f64> = level.iter().map(|l| (0.5 * l).exp()).collect();
    Some(NoiseChange {
        first,
        last,
        sigma: ratio.iter().map(|r| 0.5 * r * spread.sqrt()).collect(),
        axes,
        ratio,
        score: score + agree,
        share: share / (1.0 + share),
    })
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len() as f64;
    values.sum::<f64>() / n
}

/// Variances of the readings by second and first differences over some ranges, without missing readings.
fn variances(readings: &[[f64; 3]], parts: &[Range]) -> Variances {
    let of = |(order, norm): (usize, f64)| {
        let (mut sum, mut n) = ([0.0; 3], 0.0);
        for &[start, stop] in parts {
            for rows in readings[start..stop].windows(order + 1) {
                let step = |k: usize| match order {
                    1 => rows[1][k] - rows[0][k],
                    _ => rows[2][k] - 2.0 * rows[1][k] + rows[0][k],
                };
                let steps = [0, 1, 2].map(step);
                if steps.iter().all(|step| step.is_finite()) {
                    (0..3).for_each(|k| sum[k] += steps[k] * steps[k]);
                    n += 1.0;
                }
            }
        }
        (sum.map(|sum| if n > 0.0 { sum / n / norm } else { 0.0 }), n)
    };
    let [(second, n), (first, _)] = DIFFERENCES.map(of);
    ([second, first], n)
}

/// Log-likelihood of a pose at one level, `away` from it.
fn of_one_level(away: impl Iterator<Item = f64>, variance: f64) -> f64 {
    away.map(|a| -0.5 * (a * a / variance + (TAU * variance).ln()))
        .sum()
}

/// Log-likelihood of a pose with a level of its own: normal, common part and axes.
fn of_any_level(logs: &[f64], variance: f64) -> f64 {
    let (own, k) = (OF_AXES * OF_AXES + variance, logs.len() as f64);
    let weight = 1.0 + SPAN * SPAN * k / own;
    let (sum, squares) = logs
        .iter()
        .fold((0.0, 0.0), |(s, q), l| (s + l / own, q + l * l / own));
    let chi2 = squares - SPAN * SPAN * sum * sum / weight;
    -0.5 * (chi2 + k * (TAU * own).ln() + weight.ln())
}

fn mixed(one_level: f64, any_level: f64, share: f64) -> f64 {
    log_sum([(-share).ln_1p() + one_level, share.ln() + any_level])
}

/// The likeliest share of poses with a level of their own.
fn likeliest(one_level: &[f64], any_level: &[f64]) -> f64 {
    let [low, high] = SHARES;
    (0..N_SHARES)
        .map(|i| low + (high - low) * i as f64 / (N_SHARES - 1) as f64)
        .map(|share| {
            one_level
                .iter()
                .zip(any_level)
                .map(|(&a, &b)| mixed(a, b, share))
                .sum()
        })
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Score of the best interval of poses, the interval, and its level.
fn interval(logs: &[Vec<f64>], noise: &[f64]) -> Option<(f64, Range, Vec<f64>)> {
    let (n, k) = (logs.len(), logs[0].len());
    let mut without = f64::NEG_INFINITY;
    let mut best: Option<(f64, Range, Vec<f64>)> = None;
    for scatter in SCATTERS {
        let variance: Vec<f64> = noise.iter().map(|v| v + scatter * scatter).collect();
        let at = |i: usize, level: &[f64]| {
            of_one_level(logs[i].iter().zip(level).map(|(l, m)| l - m), variance[i])
        };
        let usual: Vec<f64> = (0..n).map(|i| at(i, &vec![0.0; k])).collect();
        let own: Vec<f64> = (0..n)
            .map(|i| of_any_level(&logs[i], variance[i]))
            .collect();
        without = without.max(likeliest(&usual, &own));
        let gain = |level: &Vec<f64>| -> Vec<f64> {
            (0..n)
                .map(|i| {
                    mixed(at(i, level), own[i], USUAL_SHARE) - mixed(usual[i], own[i], USUAL_SHARE)
                })
                .collect()
        };
        let mut tried: Vec<Range> = logs
            .iter()
            .map(|level| longest_gain(&gain(level)))
            .collect();
        tried.sort_unstable();
        tried.dedup();
        for [first, stop] in tried {
            // A pose at the usual level gains nowhere: its interval is empty.
            if stop == first || stop - first > n / 2 {
                continue;
            }
            let middle =
                |k: usize| median(&mut logs[first..stop].iter().map(|l| l[k]).collect::<Vec<_>>());
            let level: Vec<f64> = (0..k).map(middle).collect();
            let spread = 1.0 / variance[first..stop].iter().map(|v| 1.0 / v).sum::<f64>();
            let mut as_one = usual.clone();
            (first..stop).for_each(|i| as_one[i] = at(i, &level));
            // The level is integrated out: its prior is that of a loud pose.
            let gain = likeliest(&as_one, &own)
                + of_any_level(&level, 0.0)
                + 0.5 * k as f64 * (TAU * spread).ln();
            if best.as_ref().is_none_or(|(known, ..)| gain > *known) {
                best = Some((gain, [first, stop], level));
            }
        }
    }
    // Two sensors, and every interval of poses.
    let looks = (n * (n + 1)) as f64;
    best.map(|(gain, range, level)| (2.0 * (gain - without) - 2.0 * looks.ln(), range, level))
}

/// The half-open range with the largest sum.
fn longest_gain(gain: &[f64]) -> Range {
    let (mut total, mut lowest, mut best) = (0.0, (0.0, 0), (0.0, [0, 0]));
    for (i, g) in gain.iter().enumerate() {
        total += g;
        if total < lowest.0 {
            lowest = (total, i + 1);
        }
        if total - lowest.0 > best.0 {
            best = (total - lowest.0, [lowest.1, i + 1]);
        }
    }
    best.1
}

/// Whether the excess of poses is white, or has the spectrum of the usual noise; `white` is the ratio of its variances.
fn is_noise(slow: &[Vec<f64>], fast: &[Vec<f64>], white: impl Fn(usize) -> f64) -> bool {
    let n_axes = slow[0].len();
    let middle =
        |of: &[Vec<f64>], k: usize| median(&mut of.iter().map(|l| l[k]).collect::<Vec<_>>());
    let mut away = [0.0; 2];
    for k in 0..n_axes {
        let (level, whole) = (middle(slow, k), middle(fast, k));
        away[0] += (whole - (level.exp_m1() * white(k)).max(-0.99).ln_1p()).abs();
        away[1] += (whole - level).abs();
    }
    away[0].min(away[1]) / (n_axes as f64) < SAME_SHAPE.ln()
}

/// Score by the moves, of power over the usual noise, independent squares, and whether inside the interval: the sensor's
/// noise continues through those inside, whose power is then `level` at least; `None` where it does not. Without it
/// they would be any of all moves.
fn moves_agree(moves: &[(f64, f64, bool)], level: f64) -> Option<f64> {
    let inside = moves.iter().filter(|one| one.2).count();
    if level < 1.0 || inside == 0 {
        return Some(0.0);
    }
    let reaches = |&&(power, n, _): &&(f64, f64, bool)| {
        power >= level * (1.0 - CLEAR * (2.0 * SAMPLES_OF_ONE / n.max(1.0)).sqrt())
    };
    let reach = moves.iter().filter(reaches).count();
    if !moves.iter().filter(|one| one.2).all(|one| reaches(&one)) {
        return None;
    }
    let chance = |i: usize| ((reach - i) as f64 / (moves.len() - i) as f64).ln();
    Some(-2.0 * (0..inside).map(chance).sum::<f64>())
}
