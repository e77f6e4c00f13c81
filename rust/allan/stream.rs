//! Logs that do not fit into memory: one pass, chunk by chunk, in bounded memory.
//!
//! Clusters up to [`FINE`] readings are evaluated at every reading from a window of the running sum that moves with the
//! chunks. For longer ones the running sum is kept at every `stride`-th reading (a power of two, doubled whenever the
//! kept values exceed the budget), and terms are taken at every `stride`-th start: at least [`FINE_PER_STRIDE`] starts
//! per cluster, which keep the information of every start to within 0.1 % of its variance. As long as the budget
//! suffices (`stride` = 1) the result is that of the whole array.

use super::Curve;
use super::prefix::{compensated_sum, two_sum};
use super::readings::Readings;
use super::tiles::{self, Difference};
use crate::error::{Error, Result};

/// Longest cluster that is evaluated at every reading, for logs of any length.
pub const FINE: usize = 65536;
/// Fewest starts per cluster of the longer ones.
pub const FINE_PER_STRIDE: usize = 64;

/// Overlapping Allan variance of one channel that arrives in chunks.
#[derive(Debug, Clone)]
pub struct Stream {
    clusters: Vec<usize>,
    n_fine: usize,
    centre: f64,
    window: Vec<f64>,
    window_start: usize,
    fine: Vec<(f64, f64)>,
    kept: Vec<f64>,
    stride: usize,
    budget: usize,
    total: (f64, f64),
    n: usize,
}

/// Overlapping Allan variance of a stream.
#[derive(Debug, Clone)]
pub struct StreamedCurve {
    /// Cluster sizes as evaluated: those above [`FINE`] are multiples of `stride`; sizes without a term are left out.
    pub clusters: Vec<usize>,
    /// Variance at these cluster sizes.
    pub curve: Curve,
    /// Readings between the starts of the longer clusters.
    pub stride: usize,
    /// Number of readings.
    pub n: usize,
    /// Mean of all readings.
    pub mean: f64,
}

impl Stream {
    /// A stream for these cluster sizes (any order; doubles are dropped) that keeps at most `budget` running sums.
    ///
    /// # Errors
    /// `BadInput` for an empty list, a zero cluster or a budget below `4 · FINE`.
    pub fn new(clusters: &[usize], budget: usize) -> Result<Self> {
        if clusters.is_empty() || clusters.contains(&0) {
            return Err(Error::bad_input(
                "cluster sizes must be at least 1, and there must be one",
            ));
        }
        if budget < 4 * FINE {
            return Err(Error::bad_input(format!(
                "the stream needs room for {} running sums",
                4 * FINE
            )));
        }
        let mut clusters = clusters.to_vec();
        clusters.sort_unstable();
        clusters.dedup();
        let n_fine = clusters.partition_point(|&m| m <= FINE);
        Ok(Self {
            n_fine,
            fine: vec![(0.0, 0.0); n_fine],
            clusters,
            centre: f64::NAN,
            window: vec![0.0],
            window_start: 0,
            kept: vec![0.0],
            stride: 1,
            budget,
            total: (0.0, 0.0),
            n: 0,
        })
    }

    /// Number of readings so far.
    #[must_use]
    pub fn len(&self) -> usize {
        self.n
    }

    /// No reading has arrived yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Take the next readings.
    ///
    /// # Errors
    /// `BadInput` naming the first reading that is not finite.
    pub fn extend(&mut self, readings: &impl Readings) -> Result<()> {
        let n = readings.len();
        // Pieces bound the window for chunks of any length.
        let mut buffer = vec![0.0; n.min(4 * FINE)];
        for first in (0..n).step_by(4 * FINE) {
            let piece = &mut buffer[..(n - first).min(4 * FINE)];
            readings.fill(first, piece);
            if let Some(bad) = piece.iter().position(|v| !v.is_finite()) {
                return Err(Error::bad_input(format!(
                    "reading {} is missing or infinite: exclude it, or load the log whole, where gaps are weighted",
                    self.n + bad
                )));
            }
            if self.n == 0 {
                // The mean of the first piece suffices: a constant drops out of every difference.
                let pivot = piece[0];
                self.centre =
                    pivot + compensated_sum(piece.iter().map(|v| v - pivot)) / piece.len() as f64;
            }
            self.take(piece);
        }
        Ok(())
    }

    fn take(&mut self, piece: &[f64]) {
        for v in piece {
            let (s, e) = two_sum(self.total.0, v - self.centre);
            self.total = (s, self.total.1 + e);
            let sum = self.total.0 + self.total.1;
            self.window.push(sum);
            self.n += 1;
            if self.n.is_multiple_of(self.stride) {
                self.kept.push(sum);
            }
        }
        if self.kept.len() > self.budget {
            self.thin();
        }
        self.settle();
    }

    /// Keep every second running sum.
    fn thin(&mut self) {
        let mut place = 0;
        self.kept.retain(|_| {
            place += 1;
            place % 2 == 1
        });
        self.stride *= 2;
    }

    /// Add the terms of the fine clusters that became complete: every start whose clusters all lie in the window.
    fn settle(&mut self) {
        let Some(&longest) = self.clusters[..self.n_fine].last() else {
            self.window.clear();
            return;
        };
        let starts = self.window.len().saturating_sub(2 * longest);
        if starts == 0 {
            return;
        }
        for (sum, &m) in self.fine.iter_mut().zip(&self.clusters) {
            let energy =
                tiles::energies(&self.window[..starts + 2 * m], &[m], Difference::Second)[0];
            let (s, e) = two_sum(sum.0, energy);
            *sum = (s, sum.1 + e);
        }
        self.window.drain(..starts);
        self.window_start += starts;
    }

    /// The curve of all readings so far.
    ///
    /// # Errors
    /// `NotDetermined` when the log is too short for every cluster.
    pub fn finish(&self) -> Result<StreamedCurve> {
        let n = self.n;
        let mut out = StreamedCurve {
            clusters: Vec::new(),
            curve: Curve {
                variance: Vec::new(),
                terms: Vec::new(),
                weight: Vec::new(),
            },
            stride: self.stride,
            n,
            mean: self.centre + (self.total.0 + self.total.1) / n as f64,
        };
        for (c, &m) in self.clusters.iter().enumerate() {
            let (m, energy, terms) = if c < self.n_fine {
                let rest = tiles::energies(&self.window, &[m], Difference::Second)[0];
                (
                    m,
                    self.fine[c].0 + (self.fine[c].1 + rest),
                    (n + 1).saturating_sub(2 * m),
                )
            } else {
                let lag = m.div_ceil(self.stride);
                let energy = tiles::energies(&self.kept, &[lag], Difference::Second)[0];
                (
                    lag * self.stride,
                    energy,
                    self.kept.len().saturating_sub(2 * lag),
                )
            };
            if terms == 0 || out.clusters.last() == Some(&m) {
                continue;
            }
            out.clusters.push(m);
            out.curve
                .variance
                .push(energy / (2.0 * (m as f64).powi(2) * terms as f64));
            out.curve.terms.push(terms);
            out.curve.weight.push(terms as f64);
        }
        if out.clusters.is_empty() {
            return Err(Error::not_determined(format!(
                "{n} readings are too few for the requested cluster sizes"
            )));
        }
        Ok(out)
    }

    /// Means of consecutive clusters of `lag · stride` readings, and that number of readings.
    ///
    /// `lag` is the smallest that gives means of at least `readings` readings.
    #[must_use]
    pub fn means(&self, readings: usize) -> (Vec<f64>, usize) {
        let lag = readings.div_ceil(self.stride).max(1);
        let size = lag * self.stride;
        let ends = self.kept.iter().step_by(lag);
        let means = ends
            .clone()
            .zip(ends.skip(1))
            .map(|(a, b)| self.centre + (b - a) / size as f64)
            .collect();
        (means, size)
    }
}
