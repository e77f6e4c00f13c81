//! What samples leave out: averaging over their interval, as decimating filters do (docs/model-session.md, 11.6d), and
//! motion faster than the samples, by which every move's integral is in error (docs/diagnosis-method.md, 8.2a).
//!
//! A jolt on the table lasts a millisecond. Its power near the multiples of the sampling frequency f folds onto zero
//! frequency and is integrated as velocity or angle. It is extrapolated by a power law. With power c ν^-p on either side
//! of zero, the powers at f/4, at f/2 and folded onto zero are sums over all foldings,
//!
//! ```text
//! D₁ = c (f/4)^-p Z,   D₂ = 2 c (f/2)^-p Z,   A = 2 c f^-p Z / (1 - 2^-p),   Z = 1 + 3^-p + 5^-p + ...
//! ```
//!
//! so that D₁/D₂ = 2^p/2 and A = D₂/(2 D₁/D₂ - 1): all of D₂ where the samples are white (D₁ = D₂), no more, and a
//! third of it for a rate that steps (p = 2). D₁ contains slower motion too, which makes the slope look steep: up to the
//! third, only a part of D₁ is counted.

use crate::block_motion::band_power;
use crate::order_statistics::median;

/// Filters around half and a quarter of the sampling frequency. Their zeros at zero frequency, of fourth and second
/// order, remove smooth motion.
const AT_HALF: [f64; 5] = [1.0, -4.0, 6.0, -4.0, 1.0];
const AT_QUARTER: [f64; 5] = [1.0, 0.0, -2.0, 0.0, 1.0];
const LENGTH: usize = AT_HALF.len();
/// Power folded onto zero over that at half the sampling frequency for a rate with steps: 1/(2^p - 1) with p = 2.
const OF_A_STEP: f64 = 1.0 / 3.0;
/// Part of the power around a quarter of the sampling frequency that is not slower motion, for a body that impacts and
/// rocks at a tenth of the sampling frequency.
const OF_ITS_BAND: f64 = 0.4;
/// Standard deviations of the noise's own power below which no motion is counted.
const MARGIN: f64 = 3.0;

/// A step longer than this many usual ones has lost samples.
pub const GAP: f64 = 1.5;

type Range = [usize; 2];

/// Readings at the middle of their interval T, where they are means over the share `a` of it: a mean m differs from the
/// value in its middle by T²/24 of the second derivative, ω = m - a/24 (m₋ - 2 m + m₊).
///
/// A filter adds twelve times the variance of its impulse response in sample intervals: 7.6 by a first-order low-pass with
/// its corner at 0.2 of the rate, 0 by a Butterworth. For the angle of a move about one axis a does not matter; for
/// rotations that do not commute it does, and moves determine it. No second difference is taken across lost samples.
#[must_use]
pub fn sharpened(readings: &[[f64; 3]], time: &[f64], a: f64) -> Vec<[f64; 3]> {
    let steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let longest = GAP * median(&mut steps.clone());
    let mut out = readings.to_vec();
    for (k, (three, ends)) in readings.windows(3).zip(steps.windows(2)).enumerate() {
        if ends.iter().any(|&step| step >= longest) {
            continue;
        }
        for axis in 0..3 {
            let second = (three[2][axis] - three[1][axis]) - (three[1][axis] - three[0][axis]);
            out[k + 1][axis] -= if second.is_finite() {
                a * second / 24.0
            } else {
                0.0
            };
        }
    }
    out
}

/// First samples behind gaps in the timestamps.
#[must_use]
pub fn behind_gaps(time: &[f64], step_s: f64) -> Vec<usize> {
    let is_gap = |&k: &usize| time[k] - time[k - 1] > GAP * step_s;
    (1..time.len()).filter(is_gap).collect()
}

/// Variance of the integral of the readings over every move by motion above half the sampling frequency.
///
/// The poses give the power of the noise in both bands (their median), which is subtracted; at least that of rounding by
/// the LSB `quantum`, because a pose whose bias stays inside one LSB does not show its rounding, moves do. Filters run
/// from gap to gap, across which smooth motion would look fast, by the `time` of samples at intervals of `step_s`.
#[must_use]
pub fn unresolved(
    readings: &[[f64; 3]],
    (moves, poses): (&[Range], &[Range]),
    (time, step_s): (&[f64], f64),
    quantum: [f64; 3],
) -> Vec<[f64; 3]> {
    let (gaps, rounding) = (
        behind_gaps(time, step_s),
        quantum.map(|lsb| lsb * lsb / 12.0),
    );
    let poses: Vec<Range> = poses
        .iter()
        .copied()
        .filter(|&one| windows(one) > 0)
        .collect();
    let pieces: Vec<Vec<Range>> = moves.iter().map(|&one| between(one, &gaps)).collect();
    let power = |taps: [f64; 5]| -> Vec<[f64; 3]> {
        let still = band_power(readings, taps, &poses);
        let level: [f64; 3] = std::array::from_fn(|axis| {
            let of = still
                .iter()
                .zip(&poses)
                .map(|(sum, &pose)| sum[axis] / windows(pose) as f64);
            median(&mut of.collect::<Vec<f64>>()).max(rounding[axis])
        });
        let of_move = |(own, &whole): (&Vec<Range>, &Range)| {
            let n = own
                .iter()
                .map(|&piece| windows(piece))
                .sum::<usize>()
                .max(1) as f64;
            // Neighbouring outputs of five taps share samples: about a third as many squares are independent.
            let usual = 1.0 + MARGIN * (2.0 * 3.0 / n).sqrt();
            let seen = band_power(readings, taps, own);
            std::array::from_fn(|axis| {
                let sum: f64 = seen.iter().map(|one| one[axis]).sum();
                let counted: usize = own.iter().map(|&piece| windows(piece)).sum();
                // Samples across gaps are assumed to have the mean power of the move.
                (sum - usual * level[axis] * counted as f64).max(0.0) * windows(whole) as f64 / n
            })
        };
        pieces.iter().zip(moves).map(of_move).collect()
    };
    let (at_half, at_quarter) = (power(AT_HALF), power(AT_QUARTER));
    let part = folded(&at_half, &at_quarter) * step_s * step_s;
    at_half
        .iter()
        .map(|one| one.map(|value| value * part))
        .collect()
}

/// Power folded onto zero over that at half the sampling frequency. The slope between the bands depends on filter and
/// motion: that of the usual move is taken, not the largest.
fn folded(at_half: &[[f64; 3]], at_quarter: &[[f64; 3]]) -> f64 {
    let sums = at_half
        .iter()
        .zip(at_quarter)
        .map(|(half, quarter)| (half.iter().sum::<f64>(), quarter.iter().sum::<f64>()));
    let mut falls: Vec<f64> = sums
        .filter(|(half, quarter)| *half > 0.0 && *quarter > 0.0)
        .map(|(half, quarter)| half / quarter)
        .collect();
    let fall = if falls.is_empty() {
        1.0
    } else {
        median(&mut falls).min(1.0)
    };
    let slowest = (fall / OF_ITS_BAND).min(1.0);
    (fall / (2.0 - fall)).max((slowest / (2.0 - slowest)).min(OF_A_STEP))
}

/// Outputs of a filter over a range.
fn windows([start, stop]: Range) -> usize {
    (stop - start).saturating_sub(LENGTH - 1)
}

/// The parts of a range without gaps, at least a filter long. A range in which gaps dominate stays whole, because its
/// timestamps do not show gaps.
fn between([start, stop]: Range, gaps: &[usize]) -> Vec<Range> {
    let inside = gaps
        .iter()
        .copied()
        .filter(|&gap| gap > start && gap < stop);
    let ends: Vec<usize> = [start].into_iter().chain(inside).chain([stop]).collect();
    let mut parts: Vec<Range> = ends.windows(2).map(|pair| [pair[0], pair[1]]).collect();
    parts.retain(|&one| windows(one) > 0);
    let covered: usize = parts.iter().map(|&one| windows(one)).sum();
    if ends.len() > 2 && 2 * covered <= stop - start {
        parts = vec![[start, stop]];
    }
    parts.retain(|&one| windows(one) > 0);
    parts
}
