//! Motion in block means of a log: where a pose begins, and which part of a change the gyro predicts.

use nalgebra::{SMatrix, SVector};

/// The first of the rows 0 to `most` at which no deviating stretch of any of the `sizes` begins; `None` without one.
///
/// `off` are rows of `channels` deviations from the level; a stretch of `sizes[k]` rows deviates where the squares of
/// its means over `variances[k]` (channels of zero variance excluded) sum to more than `limit`.
#[must_use]
pub fn first_clean(
    off: &[f64],
    channels: usize,
    most: usize,
    sizes: &[usize],
    variances: &[f64],
    limit: f64,
) -> Option<usize> {
    let n = off.len() / channels.max(1);
    let mut total = vec![0.0; (n + 1) * channels];
    for at in channels..total.len() {
        total[at] = total[at - channels] + off[at - channels];
    }
    (0..=most).find(|&start| {
        !sizes
            .iter()
            .zip(variances.chunks_exact(channels))
            .filter(|(size, _)| start + **size <= n)
            .any(|(&size, variance)| {
                let (from, to) = (start * channels, (start + size) * channels);
                let statistic: f64 = (0..channels)
                    .filter(|&c| variance[c] > 0.0)
                    .map(|c| {
                        ((total[to + c] - total[from + c]) / size as f64).powi(2) / variance[c]
                    })
                    .sum();
                statistic > limit
            })
    })
}

/// Noise by which the ends of a pose are tested; one number per channel, or rows of one number per channel.
#[derive(Debug, Clone, Copy)]
pub struct Edges<'a> {
    /// Variance of a mean over T seconds is `white / T + flicker + walk T / 3`: three rows.
    pub noise: &'a [f64],
    /// Variance of rounding to the resolution (LSB).
    pub rounding: &'a [f64],
    /// Seconds in a block.
    pub step_s: f64,
    /// Variance of the mean of 1, 2, 4 ... blocks: a row each.
    pub variances: &'a [f64],
    /// Channels that have noise.
    pub is_live: &'a [bool],
    /// Largest sum of the squares of a stretch's deviations over their variances.
    pub limit: f64,
}

/// Blocks to trim from either end of a pose until no stretch there deviates from its middle half, at most a third each,
/// and whether that leaves more than half: none is trimmed of a pose that moves throughout.
///
/// `rows` are its block means, `bumps` ranges of blocks to exclude.
#[must_use]
pub fn ends_to_trim(rows: &[f64], bumps: &[[usize; 2]], edges: &Edges) -> (usize, usize, bool) {
    let channels = edges.rounding.len().max(1);
    let n = rows.len() / channels;
    let is_good = |i: usize| {
        !bumps
            .iter()
            .any(|&[first, last]| (first..last).contains(&i))
    };
    let good: Vec<usize> = (0..n).filter(|&i| is_good(i)).collect();
    let middle = n / 4..n - n / 4;
    let mut core: Vec<usize> = good
        .iter()
        .copied()
        .filter(|i| middle.contains(i))
        .collect();
    if core.len() < 2 {
        core.clone_from(&good);
    }
    let mut level = vec![0.0; channels];
    for &i in &core {
        for (level, value) in level.iter_mut().zip(&rows[i * channels..]) {
            *level += value;
        }
    }
    let mut off = vec![0.0; n * channels];
    for &i in &good {
        for c in 0..channels {
            off[i * channels + c] = rows[i * channels + c] - level[c] / core.len() as f64;
        }
    }
    let most = n / 3;
    let sizes: Vec<usize> = (0..edges.variances.len() / channels)
        .map(|k| 1 << k)
        .take_while(|&size| size <= most)
        .collect();
    let (white, slow) = edges.noise.split_at(channels);
    let (flicker, walk) = slow.split_at(channels);
    let duration_s = core.len() as f64 * edges.step_s;
    let of_core = |c: usize| white[c] / duration_s + flicker[c] + walk[c] * duration_s / 3.0;
    let known = |(at, &variance): (usize, &f64)| match at % channels {
        c if edges.is_live[c] => variance + of_core(c) + edges.rounding[c],
        _ => 0.0,
    };
    let variances = &edges.variances[..sizes.len() * channels];
    let variances: Vec<f64> = variances.iter().enumerate().map(known).collect();
    let clean = |off: &[f64]| {
        // The onset of a motion is below the detection limit: twice the length detected is trimmed, and one block, in
        // which the motion may begin.
        first_clean(off, channels, most, &sizes, &variances, edges.limit)
            .map_or(most, |clean| (2 * clean + 1).min(most))
    };
    let backward: Vec<f64> = off.rchunks(channels).flatten().copied().collect();
    match (clean(&off), clean(&backward)) {
        (start, tail) if start + tail > n / 2 => (0, 0, false),
        (start, tail) => (start, tail, true),
    }
}

/// Sums of the squared output of a five-tap filter over ranges of rows, without two rows at either end; missing
/// readings count as zero.
#[must_use]
pub fn band_power(rows: &[[f64; 3]], taps: [f64; 5], ranges: &[[usize; 2]]) -> Vec<[f64; 3]> {
    let scale = taps.iter().map(|t| t * t).sum::<f64>();
    ranges
        .iter()
        .map(|&[start, stop]| {
            let mut sum = [0.0; 3];
            for seen in rows[start..stop].windows(5) {
                for k in 0..3 {
                    let passed = (0..5).fold(0.0, |sum, j| sum + taps[j] * seen[j][k]);
                    let power = passed * passed / scale;
                    sum[k] += if power.is_nan() {
                        0.0
                    } else {
                        power.min(f64::MAX)
                    };
                }
            }
            sum
        })
        .collect()
}

/// Unknowns of a change predicted from the gyro: nine of scale, three of bias.
pub const UNKNOWNS: usize = 12;

/// Windows over which a reading changed: by noise, and by `mean × (W rate + z)` where the body rotated.
#[derive(Debug, Clone, Copy)]
pub struct Windows<'a> {
    /// Change of the mean from the first half to the second.
    pub change: &'a [[f64; 3]],
    /// Mean reading.
    pub mean: &'a [[f64; 3]],
    /// Mean rate with the weights of the change.
    pub rate: &'a [[f64; 3]],
}

/// Iterations of reweighted least squares for the least absolute deviations.
const REWEIGHTED: usize = 6;
/// Eigenvalues of normal equations below this part of the largest may be rounding errors.
const FREE: f64 = 1e-13;

impl Windows<'_> {
    /// `W` (row by row) and `z` that best predict the changes, by least absolute deviations in units of `scale`:
    /// disturbances and settling are not rotation.
    #[must_use]
    pub fn share(&self, scale: [f64; 3]) -> [f64; UNKNOWNS] {
        let mut solution = None;
        for _ in 0..REWEIGHTED {
            let (gram, side) = self.equations(scale, solution.as_ref());
            solution = Some(least_squares(&gram, &side));
        }
        solution.unwrap_or_default()
    }

    /// Length of the part of every change that `W` (row by row) and `z` do not predict, in units of `scale`.
    fn left(&self, solution: &[f64; UNKNOWNS], scale: [f64; 3]) -> Vec<f64> {
        let windows = self.change.iter().zip(self.mean).zip(self.rate);
        windows
            .map(|((change, mean), rate)| {
                let turn: [f64; 3] = std::array::from_fn(|i| {
                    (0..3).map(|k| solution[3 * i + k] * rate[k]).sum::<f64>() + solution[9 + i]
                });
                let told: [f64; 3] = std::array::from_fn(|i| {
                    let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                    mean[j] * turn[k] - mean[k] * turn[j]
                });
                let squares = (0..3).map(|i| ((change[i] - told[i]) / scale[i]).powi(2));
                squares.sum::<f64>().sqrt()
            })
            .collect()
    }

    /// Normal equations `(12, 12)` and `(12,)`, changes in units of `scale`, weighted for least absolute deviations
    /// from `solution` (equal weights without one).
    fn equations(
        &self,
        scale: [f64; 3],
        solution: Option<&[f64; UNKNOWNS]>,
    ) -> (Vec<f64>, Vec<f64>) {
        let weights = solution.map(|s| {
            let left = self.left(s, scale);
            let least = crate::order_statistics::median(&mut left.clone()).max(1e-12);
            left.iter()
                .map(|l| 1.0 / l.max(least))
                .collect::<Vec<f64>>()
        });
        let (mut gram, mut side) = (vec![0.0; UNKNOWNS * UNKNOWNS], vec![0.0; UNKNOWNS]);
        // Index of (row j of `W`, column k; k = 3 is `z`) among the unknowns.
        let place = |j: usize, k: usize| if k < 3 { 3 * j + k } else { 9 + j };
        for (w, ((change, mean), rate)) in
            self.change.iter().zip(self.mean).zip(self.rate).enumerate()
        {
            let weight = weights.as_ref().map_or(1.0, |v| v[w]);
            let seen = [rate[0], rate[1], rate[2], 1.0];
            let cross = [
                [0.0, -mean[2], mean[1]],
                [mean[2], 0.0, -mean[0]],
                [-mean[1], mean[0], 0.0],
            ];
            for j in 0..3 {
                let mut told = 0.0;
                let mut with = [0.0; 3];
                for i in 0..3 {
                    let share = weight * cross[i][j] / (scale[i] * scale[i]);
                    told += share * change[i];
                    for (w, c) in with.iter_mut().zip(cross[i]) {
                        *w += share * c;
                    }
                }
                for k in 0..4 {
                    let row = place(j, k);
                    side[row] += told * seen[k];
                    for (j2, w) in with.iter().enumerate() {
                        for k2 in 0..4 {
                            gram[row * UNKNOWNS + place(j2, k2)] += w * seen[k] * seen[k2];
                        }
                    }
                }
            }
        }
        (gram, side)
    }
}

/// Solution of normal equations scaled to unit columns, of minimum norm (an axis may be dead or never turned).
///
/// Half of the digits suffice for readings with a noise of 10⁻⁴.
fn least_squares(gram: &[f64], side: &[f64]) -> [f64; UNKNOWNS] {
    type Square = SMatrix<f64, UNKNOWNS, UNKNOWNS>;
    let gram = Square::from_column_slice(gram);
    let size = gram
        .diagonal()
        .map(|d| if d > 0.0 { d.sqrt() } else { 1.0 });
    let eigen = Square::from_fn(|i, j| gram[(i, j)] / (size[i] * size[j])).symmetric_eigen();
    let side = SVector::<f64, UNKNOWNS>::from_column_slice(side).component_div(&size);
    let mut along = eigen.eigenvectors.tr_mul(&side);
    let least = FREE * eigen.eigenvalues.max();
    for (along, value) in along.iter_mut().zip(&eigen.eigenvalues) {
        *along = if *value > least { *along / value } else { 0.0 };
    }
    (eigen.eigenvectors * along).component_div(&size).into()
}
