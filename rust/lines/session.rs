//! Lines above the smooth spectrum of all poses of a session.

use std::f64::consts::{PI, TAU};

use super::{power, smooth, window};
use crate::chi_square::chi_square_tails;
use crate::order_statistics::median;
use crate::sinusoid::explained;

/// Readings of a piece of a pose: twice as many give 33 frequencies, two windows of the median.
const SHORTEST: usize = 32;
/// Readings of the longest spectrum.
const LONGEST: usize = 1024;
/// Fewest spectra in the average, which has a relative error of 40 % then; with fewer their length is halved.
const ENOUGH_STRETCHES: usize = 6;
const FEWEST_STRETCHES: usize = 3;
/// Frequencies per refinement, from one resolution below to one above: half a lobe has ten.
const GRID: usize = 41;
/// Parts of a pose; the even ones predict the odd ones and vice versa.
const PARTS: usize = 8;
/// Power of a line in the second halves of poses over that in the first: ringing of a support (2 to 6 Hz, over in half a
/// second) leaves a tenth or less in poses of 2 s.
const STEADY: f64 = 0.3;
/// Standard errors of its amplitude from which a line is coherent through the recording: by noise once in 3000.
const COHERENT: f64 = 4.0;

/// A stretch of one channel: times and readings about their mean.
type Stretch = (Vec<f64>, Vec<f64>);

/// A spectral line of one channel, in its units.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    /// Number of the channel.
    pub channel: usize,
    /// Frequency and its standard error, Hz; resolution of one pose.
    pub frequency: [f64; 3],
    /// Amplitude and its standard error.
    pub amplitude: [f64; 2],
    /// Chance of such a peak in noise, over all frequencies and channels.
    pub p_value: f64,
    /// Noise around the line.
    pub noise: f64,
    /// Held-out rms without the line and with it.
    pub rms: [f64; 2],
}

/// At most one line per channel, of the contiguous `stretches` of quiet poses: times, and readings `(n, channels)` row by
/// row about their mean.
#[must_use]
pub fn lines(
    stretches: &[(&[f64], &[f64])],
    channels: usize,
    rate: f64,
    p_limit: f64,
) -> Vec<Line> {
    let count = |n: usize| stretches.iter().map(|(t, _)| t.len() / n).sum::<usize>();
    let longest = stretches
        .iter()
        .map(|(t, _)| t.len())
        .max()
        .unwrap_or(0)
        .min(LONGEST);
    if longest < SHORTEST {
        return Vec::new();
    }
    let mut n = 1 << longest.ilog2();
    while n > 2 * SHORTEST && count(n) < ENOUGH_STRETCHES {
        n /= 2;
    }
    if count(n) < FEWEST_STRETCHES {
        return Vec::new();
    }
    let of_channel = |channel: usize| -> Option<Line> {
        let own: Vec<Stretch> = stretches
            .iter()
            .map(|(t, x)| {
                (
                    t.to_vec(),
                    x.iter().skip(channel).step_by(channels).copied().collect(),
                )
            })
            .collect();
        strongest(&own, channels, (n, rate), p_limit).map(|line| Line { channel, ..line })
    };
    (0..channels).filter_map(of_channel).collect()
}

/// Mean periodogram of parts of `n` samples; the same of each part relative to its own variance, and their number.
///
/// Readings that their noise does not dither change in some parts and not in others. The mean of all follows the few that
/// change, whose peaks chance alone makes.
fn averaged(stretches: &[Stretch], n: usize) -> (Vec<f64>, Vec<f64>, f64) {
    let taper = window(n);
    let (mut whole, mut relative) = (vec![0.0; n / 2 + 1], vec![0.0; n / 2 + 1]);
    let (mut parts, mut live) = (0.0, 0.0);
    for part in stretches.iter().flat_map(|(_, x)| x.chunks_exact(n)) {
        let mean = part.iter().sum::<f64>() / n as f64;
        let centred: Vec<f64> = part.iter().map(|value| value - mean).collect();
        let variance = centred.iter().map(|value| value * value).sum::<f64>() / n as f64;
        parts += 1.0;
        live += f64::from(u8::from(variance > 0.0));
        for (k, value) in power(&centred, &taper).into_iter().enumerate() {
            whole[k] += value;
            relative[k] += if variance > 0.0 {
                value / variance
            } else {
                0.0
            };
        }
    }
    for (sum, share) in whole.iter_mut().zip(&mut relative) {
        *sum /= parts;
        *share /= live.max(1.0);
    }
    (whole, relative, live)
}

fn strongest(
    own: &[Stretch],
    channels: usize,
    (n, rate): (usize, f64),
    p_limit: f64,
) -> Option<Line> {
    let (spectrum, relative, count) = averaged(own, n);
    if relative[1..].iter().any(|&one| one <= 0.0) {
        return None;
    }
    let width = ((n / 32) | 1).max(15);
    let level = smooth(&relative, width);
    let ratio = |k: usize| relative[k] / level[k] * (1.0 - 1.0 / (3.0 * count));
    let tapered: f64 = window(n).iter().map(|weight| weight * weight).sum();
    let mut lowest = (n / 128).max(3);
    while lowest < n / 2 - 1 {
        let k = (lowest..n / 2 - 1).max_by(|&a, &b| ratio(a).total_cmp(&ratio(b)))?;
        // Adjacent bins of a Hann window share power: the free bins are about two thirds of all.
        let chance = chi_square_tails(2.0 * count * ratio(k), 2.0 * count).1;
        let p_value = (chance * (n / 2 * channels) as f64).min(1.0);
        if p_value > p_limit {
            return None;
        }
        let around = k.saturating_sub(width / 2)..(k + width / 2 + 1).min(spectrum.len());
        let density = median(&mut spectrum[around].to_vec()) / tapered;
        let bin = rate / n as f64;
        let line = refined(own, (k as f64 * bin, bin, rate), density);
        if !dies_away(own, line.frequency[0] / rate, density) {
            return Some(Line { p_value, ..line });
        }
        // Above the ringing, whose frequency differs from pose to pose.
        lowest = 2 * k;
    }
    None
}

/// Whether a line is ringing of the supports: strong at the start of poses and weak in their second half.
fn dies_away(stretches: &[Stretch], per_sample: f64, density: f64) -> bool {
    let mut total = [0.0; 2];
    for (_, x) in stretches {
        let (early, late) = x.split_at(x.len().div_ceil(2));
        for (sum, half) in total.iter_mut().zip([early, late]) {
            let (taper, n) = (window(half.len()), half.len() as f64);
            let mean = half.iter().sum::<f64>() / n;
            let (mut along, mut across, mut squares) = (0.0, 0.0, 0.0);
            for (k, (value, weight)) in half.iter().zip(&taper).enumerate() {
                let (sine, cosine) = (TAU * per_sample * k as f64).sin_cos();
                along += weight * cosine * (value - mean);
                across += weight * sine * (value - mean);
                squares += weight * weight;
            }
            *sum += (along * along + across * across) / squares - density;
        }
    }
    total[0] > 0.0 && total[1] < STEADY * total[0]
}

/// Coefficients of cosine and sine of a known frequency, by least squares over the chosen readings.
fn sinusoid(t: &[f64], x: &[f64], f: f64, is_chosen: impl Fn(usize) -> bool) -> [f64; 2] {
    let (mut cc, mut cs, mut ss, mut xc, mut xs) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for k in (0..t.len()).filter(|&k| is_chosen(k)) {
        let (sine, cosine) = (TAU * f * t[k]).sin_cos();
        cc += cosine * cosine;
        cs += cosine * sine;
        ss += sine * sine;
        xc += x[k] * cosine;
        xs += x[k] * sine;
    }
    let det = cc * ss - cs * cs;
    if det > 0.0 {
        [(ss * xc - cs * xs) / det, (cc * xs - cs * xc) / det]
    } else {
        [0.0; 2]
    }
}

/// Sums of squares of the readings that are not chosen, without the sinusoid of those that are and with it.
fn held_out(t: &[f64], x: &[f64], f: f64, is_chosen: impl Fn(usize) -> bool) -> [f64; 3] {
    let [a, b] = sinusoid(t, x, f, &is_chosen);
    let mut sums = [0.0; 3];
    for k in (0..t.len()).filter(|&k| !is_chosen(k)) {
        let (sine, cosine) = (TAU * f * t[k]).sin_cos();
        sums[0] += x[k] * x[k];
        sums[1] += (x[k] - a * cosine - b * sine).powi(2);
        sums[2] += 1.0;
    }
    sums
}

/// Frequency of the largest power on a grid about `f`, `width` to either side.
fn highest(stretches: &[(&[f64], &[f64])], f: f64, width: f64) -> f64 {
    let step = 2.0 * width / (GRID - 1) as f64;
    let mut sum = vec![0.0; GRID];
    for (t, x) in stretches {
        for (total, one) in sum.iter_mut().zip(explained(t, x, f - width, step, GRID)) {
            *total += t.len() as f64 * one;
        }
    }
    let best = (0..GRID)
        .max_by(|&a, &b| sum[a].total_cmp(&sum[b]))
        .unwrap_or(0);
    f - width + step * best as f64
}

/// Frequency and amplitude by coherent least squares over all poses; half of each pose predicts the other half.
fn refined(own: &[Stretch], (f, resolution, rate): (f64, f64, f64), density: f64) -> Line {
    let t: Vec<f64> = own.iter().flat_map(|one| one.0.iter().copied()).collect();
    let x: Vec<f64> = own.iter().flat_map(|one| one.1.iter().copied()).collect();
    let early: Vec<bool> = own
        .iter()
        .flat_map(|(t, _)| (0..t.len()).map(|k| k < t.len() / 2))
        .collect();
    let span = t[t.len() - 1] - t[0];
    // From the coarse bin to the resolution of the whole recording, in steps no wider than half a lobe.
    let longest = own.iter().map(|(t, _)| t.len()).max().unwrap_or(0) as f64;
    let (mut best, mut width, mut stretch) = (f, resolution, longest / rate);
    let middle = t[t.len() / 2];
    loop {
        stretch = stretch.min(span);
        let near: Vec<usize> = (0..t.len())
            .filter(|&k| (t[k] - middle).abs() <= stretch)
            .collect();
        let pick = |of: &[f64]| near.iter().map(|&k| of[k]).collect::<Vec<f64>>();
        best = if near.len() < 2 * SHORTEST {
            highest(&[(&t, &x)], best, width)
        } else {
            highest(&[(&pick(&t), &pick(&x))], best, width)
        };
        width /= 6.0;
        if stretch >= span {
            break;
        }
        stretch *= 3.0;
    }
    let [a, b] = sinusoid(&t, &x, best, |_| true);
    let (amplitude, noise) = (a.hypot(b), density.sqrt());
    let sigma = noise * (2.0 / t.len() as f64).sqrt();
    if amplitude < COHERENT * sigma {
        // Not coherent through the recording: the line is real, its amplitude is that of single poses.
        return wandering(own, f, resolution, noise);
    }
    let [before, after, n] = held_out(&t, &x, best, |k| early[k]);
    let of_frequency = 3f64.sqrt() / PI / span * sigma / amplitude;
    Line {
        channel: 0,
        frequency: [best, of_frequency, resolution],
        amplitude: [amplitude, sigma],
        p_value: 1.0,
        noise,
        rms: [(before / n).sqrt(), (after / n).sqrt()],
    }
}

/// A line whose phase is constant only within a pose: every other part of a pose predicts the parts between. Its
/// amplitude is that of single poses less the contribution of noise alone (2σ²·2/n).
fn wandering(own: &[Stretch], f: f64, resolution: f64, noise: f64) -> Line {
    let each: Vec<(&[f64], &[f64])> = own
        .iter()
        .map(|(t, x)| (t.as_slice(), x.as_slice()))
        .collect();
    let f = highest(&each, f, resolution);
    let (mut squares, mut total, mut sums) = (0.0, 0.0, [0.0; 3]);
    for (t, x) in &each {
        let n = t.len() as f64;
        let [a, b] = sinusoid(t, x, f, |_| true);
        squares += n * (a * a + b * b - 4.0 * noise * noise / n);
        total += n;
        for kept in 0..2 {
            let found = held_out(t, x, f, |k| (k * PARTS / t.len()) % 2 == kept);
            (0..3).for_each(|k| sums[k] += found[k]);
        }
    }
    let poses = (each.len() as f64).max(1.0).sqrt();
    Line {
        channel: 0,
        frequency: [f, resolution / poses, resolution],
        amplitude: [
            (squares / total).max(0.0).sqrt(),
            noise * (2.0 / total).sqrt(),
        ],
        p_value: 1.0,
        noise,
        rms: [(sums[0] / sums[2]).sqrt(), (sums[1] / sums[2]).sqrt()],
    }
}
