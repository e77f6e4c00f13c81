//! Rate of change of a logged channel, smoothed as little as its noise and its resolution allow.

/// Smoothing before the rate of change is taken, s: of a fine thermometer, whose temperature may go up and down within
/// a minute, and of one whose resolution is about a tenth of a kelvin.
const WINDOWS: [f64; 2] = [2.5, 10.0];
/// Error of the rate of temperature, in its rms, that takes one part in a hundred off an effect's size.
const SMALL_PART: f64 = 0.1;
/// Blocks of samples per smoothing width: the blocks widen it by a part in 2400, and reduce windows of thousands of
/// samples to dozens of means.
const BLOCKS_OF_WIDTH: f64 = 10.0;
/// Half-width of a Gaussian, in standard deviations.
const REACH: f64 = 4.0;

/// Rate of change, per second, of every one of the `values` at `time`, of which there are `rate_hz` in a second.
#[must_use]
pub fn slope(values: &[f64], time: &[f64], rate_hz: f64) -> Vec<f64> {
    let [fine, coarse] = WINDOWS;
    let found = smoothed(values, time, fine * rate_hz);
    let error = error_of_mean(values, fine * rate_hz);
    if error <= SMALL_PART * fine * rms(&found) {
        found
    } else {
        smoothed(values, time, coarse * rate_hz)
    }
}

/// Rate of change of values smoothed by a Gaussian of `width` samples.
///
/// Timestamps are smoothed too: a straight line keeps its slope across pauses, and to the ends. Smoothing takes
/// `width²/2` times its second derivative off a slope, and twice the width four times as much: both together take
/// neither (Richardson), so that the slope of what changes over a few widths keeps its size.
fn smoothed(values: &[f64], time: &[f64], width: f64) -> Vec<f64> {
    let length = whole(width / BLOCKS_OF_WIDTH);
    let (level, at) = (means(values, length), means(time, length));
    if level.len() < 2 {
        return vec![0.0; values.len()];
    }
    let blocks = (width / of(length)).max(1.0);
    let [narrow, wide] = [1.0, 2.0].map(|times| {
        gradient(
            &gaussian(&level, times * blocks),
            &gaussian(&at, times * blocks),
        )
    });
    let slope: Vec<f64> = narrow
        .iter()
        .zip(wide)
        .map(|(n, w)| (4.0 * n - w) / 3.0)
        .collect();
    let mut k = 0;
    let between = |&t: &f64| {
        while k + 2 < at.len() && at[k + 1] <= t {
            k += 1;
        }
        let part = ((t - at[k]) / (at[k + 1] - at[k])).clamp(0.0, 1.0);
        slope[k] + part * (slope[k + 1] - slope[k])
    };
    time.iter().map(between).collect()
}

/// Error of a mean over `width` samples, of noise and of rounding: by third differences of such means, in which a
/// smooth course cancels; infinite where there are none.
fn error_of_mean(values: &[f64], width: f64) -> f64 {
    let length = whole(width);
    let means = means(&values[..values.len() / length * length], length);
    let differences: Vec<f64> = means
        .windows(4)
        .map(|m| m[3] - 3.0 * (m[2] - m[1]) - m[0])
        .collect();
    if differences.is_empty() {
        return f64::INFINITY;
    }
    // The squares of 1, 3, 3, 1 add up to 20.
    rms(&differences) / 20.0_f64.sqrt()
}

/// Means of blocks of `length` values; the last block may be shorter.
fn means(values: &[f64], length: usize) -> Vec<f64> {
    values
        .chunks(length)
        .map(|block| block.iter().sum::<f64>() / of(block.len()))
        .collect()
}

/// Values smoothed by a Gaussian of `width` values; beyond the ends they are as there.
fn gaussian(values: &[f64], width: f64) -> Vec<f64> {
    let reach = whole(REACH * width);
    let weights: Vec<f64> = (0..=2 * reach)
        .map(|k| (-0.5 * ((of(k) - of(reach)) / width).powi(2)).exp())
        .collect();
    let sum: f64 = weights.iter().sum();
    let last = values.len() - 1;
    let here = |i: usize| {
        let near = weights
            .iter()
            .zip(i..)
            .map(|(w, k)| w * values[k.saturating_sub(reach).min(last)]);
        near.sum::<f64>() / sum
    };
    (0..values.len()).map(here).collect()
}

/// Slope of `y` over `x` of the parabola through every value and its neighbours; of the line between the two at an end.
fn gradient(y: &[f64], x: &[f64]) -> Vec<f64> {
    let steps: Vec<f64> = x.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let lines: Vec<f64> = y
        .windows(2)
        .zip(&steps)
        .map(|(pair, step)| (pair[1] - pair[0]) / step)
        .collect();
    let inner = lines.windows(2).zip(steps.windows(2));
    let inner = inner.map(|(l, s)| (s[1] * l[0] + s[0] * l[1]) / (s[0] + s[1]));
    let ends = [lines[0], lines[lines.len() - 1]];
    std::iter::once(ends[0])
        .chain(inner)
        .chain([ends[1]])
        .collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / of(values.len())).sqrt()
}

#[expect(clippy::cast_precision_loss, reason = "numbers of samples")]
fn of(n: usize) -> f64 {
    n as f64
}

/// The nearest whole number, 1 at least.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a number of samples"
)]
fn whole(number: f64) -> usize {
    number.round_ties_even().max(1.0) as usize
}
