//! Sums of squared second and third differences of a running sum, for many lags in one pass over the memory.
//!
//! A tile of the running sum is visited once and all lags pass over it while it is in the cache; the far ends of
//! neighbouring lags lie close together and are found in the cache as well. Tiles are handed to the threads in order,
//! so that all threads work on neighbouring memory; each tile leaves one number per lag and these are added in order,
//! with compensation: the result does not depend on the number of threads.

// The loops are compiled once per instruction set: they take on the features of the function they are inlined into.
#![expect(
    clippy::inline_always,
    reason = "a loop that is not inlined keeps the features of the baseline"
)]

use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::prefix::compensated_sum;
use crate::interrupt;

/// Terms per tile: 256 KiB of running sum, a fraction of a second-level cache.
const TILE: usize = 32768;
/// Independent partial sums per loop: enough for the longest vectors in use to hide their latency.
const LANES: usize = 32;

/// Which difference of the running sum is squared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Difference {
    /// `P[k+2m] − 2 P[k+m] + P[k]`
    Second,
    /// `P[k+3m] − 3 P[k+2m] + 3 P[k+m] − P[k]`
    Third,
}

impl Difference {
    fn order(self) -> usize {
        match self {
            Self::Second => 2,
            Self::Third => 3,
        }
    }
}

/// `Σ_k (difference with lag m)²` over every `k`, for each lag `m` in `lags`; zero where the lag leaves no term.
#[must_use]
pub fn energies(p: &[f64], lags: &[usize], difference: Difference) -> Vec<f64> {
    let order = difference.order();
    let kernel = Kernel::detect();
    let longest = lags
        .iter()
        .map(|&m| p.len().saturating_sub(order * m))
        .max()
        .unwrap_or(0);
    let tiles = longest.div_ceil(TILE);
    let mut ascending: Vec<usize> = (0..lags.len()).collect();
    ascending.sort_by_key(|&c| lags[c]);
    let mut partial = vec![0.0; tiles * lags.len()];
    let next = AtomicUsize::new(0);
    let rows: Vec<std::sync::Mutex<&mut [f64]>> = partial
        .chunks_mut(lags.len().max(1))
        .map(std::sync::Mutex::new)
        .collect();
    (0..rayon::current_num_threads().min(tiles.max(1)))
        .into_par_iter()
        .with_max_len(1)
        .for_each(|_| {
            loop {
                let tile = next.fetch_add(1, Ordering::Relaxed);
                let Some(row) = rows.get(tile) else { return };
                if interrupt::is_requested() {
                    return;
                }
                // No other thread takes this row: the lock never waits.
                let mut row = row
                    .lock()
                    .unwrap_or_else(std::sync::PoisonError::into_inner);
                let first = tile * TILE;
                let stop = |c: usize| (first + TILE).min(p.len().saturating_sub(order * lags[c]));
                let mut next = ascending.as_slice();
                while let [c, rest @ ..] = next {
                    match rest {
                        // Two lags at a time share the near end of their differences.
                        [d, rest @ ..]
                            if difference == Difference::Second
                                && first < stop(*d)
                                && stop(*c) == stop(*d) =>
                        {
                            (row[*c], row[*d]) =
                                kernel.two_energies(p, first, stop(*c), lags[*c], lags[*d]);
                            next = rest;
                        }
                        _ => {
                            if first < stop(*c) {
                                row[*c] = kernel.energy(p, first, stop(*c), lags[*c], difference);
                            }
                            next = rest;
                        }
                    }
                }
            }
        });
    drop(rows);
    (0..lags.len())
        .map(|c| compensated_sum(partial.iter().skip(c).step_by(lags.len()).copied()))
        .collect()
}

/// The instructions this processor offers, found at run time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kernel {
    /// 512-bit vectors.
    Avx512,
    /// 256-bit vectors with fused multiply-add.
    Avx2,
    /// The baseline instructions of the target.
    Portable,
}

impl Kernel {
    /// The widest that this processor has.
    #[must_use]
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if std::arch::is_x86_feature_detected!("avx512f") {
                return Self::Avx512;
            }
            if std::arch::is_x86_feature_detected!("avx2")
                && std::arch::is_x86_feature_detected!("fma")
            {
                return Self::Avx2;
            }
        }
        Self::Portable
    }

    /// `Σ (difference with lag m)²` over `k` in `first..stop`.
    ///
    /// # Panics
    /// When `stop` plus the difference's reach exceeds `p`.
    #[must_use]
    pub fn energy(
        self,
        p: &[f64],
        first: usize,
        stop: usize,
        m: usize,
        difference: Difference,
    ) -> f64 {
        let n = stop - first;
        let at = |steps: usize| &p[first + steps * m..][..n];
        match difference {
            Difference::Second => self.second(at(0), at(1), at(2)),
            Difference::Third => self.third(at(0), at(1), at(2), at(3)),
        }
    }

    /// Second differences with two lags.
    fn two_energies(
        self,
        p: &[f64],
        first: usize,
        stop: usize,
        m1: usize,
        m2: usize,
    ) -> (f64, f64) {
        let at = |offset: usize| &p[first + offset..][..stop - first];
        let (a, b, c, d, e) = (at(0), at(m1), at(2 * m1), at(m2), at(2 * m2));
        match self {
            // SAFETY: `detect` saw the instructions on this processor.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { two_avx512(a, b, c, d, e) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { two_avx2(a, b, c, d, e) },
            _ => two::<false>(a, b, c, d, e),
        }
    }

    fn second(self, a: &[f64], b: &[f64], c: &[f64]) -> f64 {
        match self {
            // SAFETY: `detect` saw the instructions on this processor.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { second_avx512(a, b, c) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { second_avx2(a, b, c) },
            _ => second::<false>(a, b, c),
        }
    }

    fn third(self, a: &[f64], b: &[f64], c: &[f64], d: &[f64]) -> f64 {
        match self {
            // SAFETY: `detect` saw the instructions on this processor.
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { third_avx512(a, b, c, d) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { third_avx2(a, b, c, d) },
            _ => third::<false>(a, b, c, d),
        }
    }
}

#[inline(always)]
fn add_square<const FUSED: bool>(value: f64, to: f64) -> f64 {
    if FUSED {
        value.mul_add(value, to)
    } else {
        value * value + to
    }
}

#[inline(always)]
fn second<const FUSED: bool>(a: &[f64], b: &[f64], c: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (aa, at) = a.as_chunks::<LANES>();
    let (bb, bt) = b.as_chunks::<LANES>();
    let (cc, ct) = c.as_chunks::<LANES>();
    for ((a, b), c) in aa.iter().zip(bb).zip(cc) {
        for lane in 0..LANES {
            let d = (c[lane] - b[lane]) - (b[lane] - a[lane]);
            sums[lane] = add_square::<FUSED>(d, sums[lane]);
        }
    }
    let mut tail = 0.0;
    for ((a, b), c) in at.iter().zip(bt).zip(ct) {
        tail = add_square::<FUSED>((c - b) - (b - a), tail);
    }
    sums.iter().sum::<f64>() + tail
}

#[inline(always)]
fn two<const FUSED: bool>(a: &[f64], b: &[f64], c: &[f64], d: &[f64], e: &[f64]) -> (f64, f64) {
    const LANES: usize = 16;
    let (mut near, mut far) = ([0.0; LANES], [0.0; LANES]);
    let (aa, at) = a.as_chunks::<LANES>();
    let (bb, bt) = b.as_chunks::<LANES>();
    let (cc, ct) = c.as_chunks::<LANES>();
    let (dd, dt) = d.as_chunks::<LANES>();
    let (ee, et) = e.as_chunks::<LANES>();
    for ((((a, b), c), d), e) in aa.iter().zip(bb).zip(cc).zip(dd).zip(ee) {
        for lane in 0..LANES {
            let one = (c[lane] - b[lane]) - (b[lane] - a[lane]);
            near[lane] = add_square::<FUSED>(one, near[lane]);
            let two = (e[lane] - d[lane]) - (d[lane] - a[lane]);
            far[lane] = add_square::<FUSED>(two, far[lane]);
        }
    }
    let (mut sum, mut other) = (near.iter().sum::<f64>(), far.iter().sum::<f64>());
    for ((((a, b), c), d), e) in at.iter().zip(bt).zip(ct).zip(dt).zip(et) {
        sum = add_square::<FUSED>((c - b) - (b - a), sum);
        other = add_square::<FUSED>((e - d) - (d - a), other);
    }
    (sum, other)
}

#[inline(always)]
fn third<const FUSED: bool>(a: &[f64], b: &[f64], c: &[f64], d: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (aa, at) = a.as_chunks::<LANES>();
    let (bb, bt) = b.as_chunks::<LANES>();
    let (cc, ct) = c.as_chunks::<LANES>();
    let (dd, dt) = d.as_chunks::<LANES>();
    let value = |a: f64, b: f64, c: f64, d: f64| ((d - c) - (c - b)) - ((c - b) - (b - a));
    for (((a, b), c), d) in aa.iter().zip(bb).zip(cc).zip(dd) {
        for lane in 0..LANES {
            sums[lane] = add_square::<FUSED>(value(a[lane], b[lane], c[lane], d[lane]), sums[lane]);
        }
    }
    let mut tail = 0.0;
    for (((a, b), c), d) in at.iter().zip(bt).zip(ct).zip(dt) {
        tail = add_square::<FUSED>(value(*a, *b, *c, *d), tail);
    }
    sums.iter().sum::<f64>() + tail
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn second_avx512(a: &[f64], b: &[f64], c: &[f64]) -> f64 {
    second::<true>(a, b, c)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn second_avx2(a: &[f64], b: &[f64], c: &[f64]) -> f64 {
    second::<true>(a, b, c)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn third_avx512(a: &[f64], b: &[f64], c: &[f64], d: &[f64]) -> f64 {
    third::<true>(a, b, c, d)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn third_avx2(a: &[f64], b: &[f64], c: &[f64], d: &[f64]) -> f64 {
    third::<true>(a, b, c, d)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f")]
fn two_avx512(a: &[f64], b: &[f64], c: &[f64], d: &[f64], e: &[f64]) -> (f64, f64) {
    two::<true>(a, b, c, d, e)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn two_avx2(a: &[f64], b: &[f64], c: &[f64], d: &[f64], e: &[f64]) -> (f64, f64) {
    two::<true>(a, b, c, d, e)
}
