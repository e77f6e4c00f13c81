//! Stretches halved repeatedly, and the differences between the means of two halves (an unbalanced Haar transform).

/// Differences of halves: every stretch as a whole first, then all its halves, and so on to one block.
#[derive(Debug, Clone, PartialEq)]
pub struct Halves {
    /// `(k, channels)` half the squared difference of the means of two halves, row by row.
    pub square: Vec<f64>,
    /// Blocks in a half: the harmonic mean where the halves differ by one.
    pub size: Vec<f64>,
    /// Number of halvings before: 0 for a stretch as a whole.
    pub depth: Vec<i64>,
    /// Index of the stretch of each difference.
    pub stretch: Vec<i64>,
}

/// Halves of `blocks` `(m, channels)`, row by row, in stretches `(first, stop)` of blocks.
#[must_use]
pub fn halves(blocks: &[f64], channels: usize, stretches: &[(usize, usize)]) -> Halves {
    let total = running_total(blocks, channels);
    let mut out = Halves {
        square: Vec::new(),
        size: Vec::new(),
        depth: Vec::new(),
        stretch: Vec::new(),
    };
    let is_whole = |&(_, (first, last)): &(i64, (usize, usize))| last >= first + 2;
    let mut parts: Vec<(i64, (usize, usize))> = (0_i64..).zip(stretches.iter().copied()).collect();
    for depth in 0.. {
        parts.retain(is_whole);
        if parts.is_empty() {
            break;
        }
        for &(stretch, (first, last)) in &parts {
            let middle = usize::midpoint(first, last);
            let (before, after) = ((middle - first) as f64, (last - middle) as f64);
            let at = |block: usize| &total[block * channels..][..channels];
            for ((low, mid), high) in at(first).iter().zip(at(middle)).zip(at(last)) {
                let difference = (high - mid) / after - (mid - low) / before;
                out.square.push(difference * difference / 2.0);
            }
            out.size.push(2.0 / (1.0 / before + 1.0 / after));
            out.depth.push(depth);
            out.stretch.push(stretch);
        }
        let split = |late: bool| {
            parts.iter().map(move |&(stretch, (first, last))| {
                let middle = usize::midpoint(first, last);
                (
                    stretch,
                    if late {
                        (middle, last)
                    } else {
                        (first, middle)
                    },
                )
            })
        };
        parts = split(false).chain(split(true)).collect();
    }
    out
}

/// `(m + 1, channels)` sums of the blocks before each, about their mean: a large offset costs no precision. A block
/// without readings, which no stretch contains, adds nothing.
fn running_total(blocks: &[f64], channels: usize) -> Vec<f64> {
    let rows = || blocks.chunks_exact(channels.max(1));
    let mut mean = vec![0.0; channels];
    let present = rows().filter(|row| row.iter().all(|v| v.is_finite()));
    for (n, row) in present.enumerate() {
        for (mean, value) in mean.iter_mut().zip(row) {
            *mean += (value - *mean) / (n + 1) as f64;
        }
    }
    let mut total = vec![0.0; channels];
    total.reserve_exact(blocks.len());
    for (at, value) in blocks.iter().enumerate() {
        let change = value - mean[at % channels];
        total.push(total[at] + if change.is_finite() { change } else { 0.0 });
    }
    total
}
