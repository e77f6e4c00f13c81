//! Readings that equal the one before: how often, how long, and how often in every short window.

use rayon::prelude::*;

use super::SHARE;

/// Rows of a window, a divisor of a share.
pub const WINDOW: usize = 64;

/// Three axes, and the triad as a whole.
const KINDS: usize = 4;

/// Where a reading equals the one before it.
#[derive(Debug, Clone, PartialEq)]
pub struct Repeats {
    /// Rows that equal the row before, by axis and as a whole.
    pub count: [u64; KINDS],
    /// Rows of the longest run of equal ones.
    pub longest: [u64; KINDS],
    /// First row of the first such run.
    pub start: [u64; KINDS],
    /// Equal rows of every whole window of 64, from the second row on, and of the rows after the last whole window.
    pub windows: Vec<[u8; KINDS]>,
    /// Number of rows with a reading that is not finite.
    pub missing: u64,
    /// The first such row; `None` where all are finite.
    pub first_missing: Option<u64>,
}

/// Repeats in one share of the rows.
struct Part {
    count: [u64; KINDS],
    /// Equal rows at the start of the share, `None` where all its rows are equal.
    head: [Option<u64>; KINDS],
    /// Longest run that starts inside: rows, and where it starts.
    inner: [(u64, u64); KINDS],
    /// Rows of the run that is open at the end of the share, if the share has a break.
    tail: [u64; KINDS],
    windows: Vec<[u8; KINDS]>,
    len: u64,
    stop: u64,
    missing: u64,
    first_missing: Option<u64>,
}

/// Repeated rows of a triad.
#[must_use]
pub fn repeats(rows: &[[f64; 3]]) -> Repeats {
    let n = rows.len().saturating_sub(1);
    let parts: Vec<Part> = (0..n.div_ceil(SHARE))
        .into_par_iter()
        .map(|k| part(rows, 1 + k * SHARE, (1 + (k + 1) * SHARE).min(rows.len())))
        .collect();
    let mut out = Repeats {
        count: [0; KINDS],
        longest: [1; KINDS],
        start: [0; KINDS],
        windows: Vec::with_capacity(n / WINDOW + 1),
        missing: 0,
        first_missing: None,
    };
    if let Some(first) = rows.first()
        && !first.iter().all(|v| v.is_finite())
    {
        out.missing = 1;
        out.first_missing = Some(0);
    }
    let mut open = [(1_u64, 0_u64); KINDS];
    for part in parts {
        for k in 0..KINDS {
            out.count[k] += part.count[k];
            match part.head[k] {
                None => open[k].0 += part.len,
                Some(head) => {
                    keep_longer(&mut out, k, (open[k].0 + head, open[k].1));
                    keep_longer(&mut out, k, part.inner[k]);
                    open[k] = (part.tail[k], part.stop - part.tail[k]);
                }
            }
        }
        out.windows.extend(&part.windows);
        out.missing += part.missing;
        out.first_missing = out.first_missing.or(part.first_missing);
    }
    for k in 0..KINDS {
        keep_longer(&mut out, k, open[k]);
    }
    out
}

fn keep_longer(out: &mut Repeats, k: usize, run: (u64, u64)) {
    if run.0 > out.longest[k] {
        out.longest[k] = run.0;
        out.start[k] = run.1;
    }
}

fn part(rows: &[[f64; 3]], first: usize, stop: usize) -> Part {
    let mut out = Part {
        count: [0; KINDS],
        head: [None; KINDS],
        inner: [(0, 0); KINDS],
        tail: [0; KINDS],
        windows: Vec::with_capacity((stop - first).div_ceil(WINDOW)),
        len: (stop - first) as u64,
        stop: stop as u64,
        missing: 0,
        first_missing: None,
    };
    // Rows of the open run since the last break; up to the first break they form the head.
    let mut run = [0_u64; KINDS];
    let mut at = first;
    while at < stop {
        let end = (at + WINDOW).min(stop);
        let mut same = [0_u64; KINDS];
        let mut finite = u64::MAX;
        for i in at..end {
            let (before, row) = (rows[i - 1], rows[i]);
            let bit = 1_u64 << (i - at);
            // Equal to the last bit.
            #[allow(clippy::float_cmp)]
            let equal: [bool; 3] = std::array::from_fn(|axis| row[axis] == before[axis]);
            for axis in 0..3 {
                same[axis] |= if equal[axis] { bit } else { 0 };
            }
            let is_finite = row.iter().all(|v| v.is_finite());
            finite &= if is_finite { u64::MAX } else { !bit };
        }
        same[3] = same[0] & same[1] & same[2];
        if finite != u64::MAX {
            out.missing += u64::from(finite.count_zeros());
            let here = at as u64 + u64::from(finite.trailing_ones());
            out.first_missing = out.first_missing.or(Some(here));
        }
        let len = end - at;
        for k in 0..KINDS {
            follow(&mut out, k, same[k], at as u64, len as u64, &mut run[k]);
        }
        // At most 64 ones.
        #[allow(clippy::cast_possible_truncation)]
        out.windows.push(same.map(|bits| bits.count_ones() as u8));
        at = end;
    }
    out.tail = run;
    out
}

/// Runs of one window: bit `i` of `bits` is set where row `at + i` equals the row before, for `len` rows.
fn follow(out: &mut Part, k: usize, bits: u64, at: u64, len: u64, run: &mut u64) {
    if bits == 0 && out.head[k].is_some() && *run <= out.inner[k].0 && out.inner[k].0 > 0 {
        // Nothing repeats, and the run that ends here is not the longest.
        *run = 1;
        return;
    }
    out.count[k] += u64::from(bits.count_ones());
    for i in 0..len {
        if bits >> i & 1 == 1 {
            *run += 1;
        } else {
            close(out, k, at + i, *run);
            *run = 1;
        }
    }
}

/// A run of `rows` that ends in front of row `end`: the head of the share, or one that started inside.
fn close(out: &mut Part, k: usize, end: u64, rows: u64) {
    if out.head[k].is_none() {
        out.head[k] = Some(rows);
    } else if rows > out.inner[k].0 {
        out.inner[k] = (rows, end - rows);
    }
}
