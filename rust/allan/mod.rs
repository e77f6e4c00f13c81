//! Allan variance and its relatives of equally spaced rate data, at memory bandwidth.
//!
//! Everything is computed from the running sum `P` (`P[0] = 0`, `P[k] = x[0] + … + x[k-1]`) of the readings without
//! their mean. With `n` readings and clusters of `m` readings, `D2[k] = P[k+2m] − 2 P[k+m] + P[k]` is `m` times the
//! difference of two neighbouring means:
//!
//! | kind | variance | terms |
//! |---|---|---|
//! | overlapping | `Σ D2² / (2 m² terms)`, every `k` | `n − 2m + 1` |
//! | non-overlapping | the same, every `m`-th `k` | `⌊n/m⌋ − 1` |
//! | modified | `Σ (Σ_{i=k}^{k+m−1} D2[i])² / (2 m⁴ terms)` | `n − 3m + 2` |
//! | Hadamard | `Σ D3² / (6 m² terms)`, third difference | `n − 3m + 1` |
//! | total | as overlapping, `P` continued by reflection about its ends | `n − 1` |
//!
//! Memory beside the input: one running sum (8 bytes per reading of one channel). Terms are computed in tiles of the
//! running sum that stay in the cache while all clusters pass over them; see [`tiles`].

pub mod along;
pub mod degrees;
pub mod edges;
mod losses;
pub mod prefix;
pub mod readings;
pub mod stream;
pub mod tiles;
pub mod weighted;

use crate::error::{Error, Result};

pub use readings::{Column, Readings};
pub use stream::Stream;

/// Which variance of the family.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Every pair of neighbouring clusters, one for each reading.
    Overlapping,
    /// Disjoint clusters only.
    NonOverlapping,
    /// Averaged over the phase as well: separates white from flicker phase noise.
    Modified,
    /// Third difference: blind to a linear ramp.
    Hadamard,
    /// Data continued by reflection: the least uncertain at the longest clusters.
    Total,
}

impl Kind {
    /// Number of terms for `n` readings and clusters of `m`; zero when there is none.
    #[must_use]
    pub fn terms(self, n: usize, m: usize) -> usize {
        if m == 0 {
            return 0;
        }
        match self {
            Self::Overlapping => (n + 1).saturating_sub(2 * m),
            Self::NonOverlapping => (n / m).saturating_sub(1),
            Self::Modified => (n + 2).saturating_sub(3 * m),
            Self::Hadamard => (n + 1).saturating_sub(3 * m),
            // Beyond n/2 nearly every term would consist of reflected readings.
            Self::Total if 2 * m <= n => n - 1,
            Self::Total => 0,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Overlapping => "overlapping",
            Self::NonOverlapping => "non-overlapping",
            Self::Modified => "modified",
            Self::Hadamard => "Hadamard",
            Self::Total => "total",
        }
    }
}

/// Variance against cluster size.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Variances, in the square of the unit of the readings.
    pub variance: Vec<f64>,
    /// Number of terms in each variance.
    pub terms: Vec<usize>,
    /// Sum of the weights of the terms: the number of terms where no reading is missing.
    pub weight: Vec<f64>,
}

/// Checks that every cluster size has a term.
///
/// # Errors
/// `BadInput` naming the first cluster size that is zero or too long for `n` readings.
pub fn check_clusters(n: usize, clusters: &[usize], kind: Kind) -> Result<()> {
    if clusters.is_empty() {
        return Err(Error::bad_input("at least one cluster size is needed"));
    }
    for &m in clusters {
        if m == 0 {
            return Err(Error::bad_input(
                "a cluster holds at least one reading, got 0",
            ));
        }
        if kind.terms(n, m) == 0 {
            return Err(Error::bad_input(format!(
                "{n} readings hold no pair of clusters of {m} readings for the {} variance: \
                 give smaller clusters or a longer log",
                kind.name()
            )));
        }
    }
    Ok(())
}

/// Variances of one channel, with the running sum in memory of the caller, one longer than the readings; a reading that
/// is not finite is missing.
///
/// Missing readings are never interpolated: see [`weighted`].
///
/// # Errors
/// `BadInput` for cluster sizes without a term, infinite readings, or missing readings where the kind allows none.
///
/// # Panics
/// When `workspace` has another length.
pub fn variances_in(
    readings: &impl Readings,
    clusters: &[usize],
    kind: Kind,
    workspace: &mut [f64],
) -> Result<Curve> {
    check_clusters(readings.len(), clusters, kind)?;
    let (centre, present) = prefix::write_running_sum(readings, workspace);
    match present {
        None => Ok(from_running_sum(workspace, clusters, kind)),
        Some(0) => Err(Error::bad_input("the channel holds no finite reading")),
        Some(_) => weighted::variances(readings, centre, clusters, kind),
    }
}

/// Variances from the running sum `p` (one longer than the readings) of a channel without missing readings.
#[must_use]
pub fn from_running_sum(p: &[f64], clusters: &[usize], kind: Kind) -> Curve {
    let n = p.len() - 1;
    let terms: Vec<usize> = clusters.iter().map(|&m| kind.terms(n, m)).collect();
    let sums = match kind {
        Kind::Overlapping => tiles::energies(p, clusters, tiles::Difference::Second),
        Kind::Hadamard => tiles::energies(p, clusters, tiles::Difference::Third),
        Kind::NonOverlapping => clusters
            .iter()
            .map(|&m| edges::non_overlapping(p, m))
            .collect(),
        Kind::Modified => edges::modified(p, clusters),
        Kind::Total => {
            let mut sums = tiles::energies(p, clusters, tiles::Difference::Second);
            for (sum, &m) in sums.iter_mut().zip(clusters) {
                *sum += edges::reflected(p, m);
            }
            sums
        }
    };
    let variance = sums
        .iter()
        .zip(clusters)
        .zip(&terms)
        .map(|((sum, &m), &count)| {
            let m = m as f64;
            let per_term = match kind {
                Kind::Hadamard => 6.0 * m * m,
                Kind::Modified => 2.0 * m * m * m * m,
                _ => 2.0 * m * m,
            };
            sum / per_term / count as f64
        })
        .collect();
    let weight = terms.iter().map(|&count| count as f64).collect();
    Curve {
        variance,
        terms,
        weight,
    }
}
