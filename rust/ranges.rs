//! Means and noise of readings over ranges of rows, such as the poses of a log.

type Row = [f64; 3];

fn is_number(row: &Row) -> bool {
    row.iter().all(|value| value.is_finite())
}

/// Means of rows by owner, `n` of them, with their numbers of rows: range `k` is of `owner[k]`. Rows with a missing
/// reading are excluded; the mean of no rows is NaN. Sums are about the first row: offsets cost no precision.
#[must_use]
pub fn means_by_owner(
    rows: &[Row],
    ranges: &[[usize; 2]],
    owner: &[usize],
    n: usize,
) -> (Vec<Row>, Vec<usize>) {
    let mut about: Vec<Option<Row>> = vec![None; n];
    let (mut total, mut count) = (vec![[0.0; 3]; n], vec![0; n]);
    for (&[start, stop], &k) in ranges.iter().zip(owner) {
        for row in rows[start..stop].iter().filter(|row| is_number(row)) {
            let first = about[k].get_or_insert(*row);
            for c in 0..3 {
                total[k][c] += row[c] - first[c];
            }
            count[k] += 1;
        }
    }
    let mean = |k: usize| {
        about[k].map_or([f64::NAN; 3], |first| {
            std::array::from_fn(|c| first[c] + total[k][c] / count[k] as f64)
        })
    };
    ((0..n).map(mean).collect(), count)
}

/// `(n, channels)` means by owner of rows of `channels` numbers; NaN values are excluded one by one. NaN where none
/// remains.
#[must_use]
pub fn column_means(
    rows: &[f64],
    channels: usize,
    ranges: &[[usize; 2]],
    owner: &[usize],
    n: usize,
) -> Vec<f64> {
    let (mut sum, mut count) = (vec![0.0; n * channels], vec![0_usize; n * channels]);
    for (&[start, stop], &k) in ranges.iter().zip(owner) {
        let own = k * channels..(k + 1) * channels;
        for row in rows[start * channels..stop * channels].chunks_exact(channels) {
            let cells = sum[own.clone()].iter_mut().zip(&mut count[own.clone()]);
            for ((sum, count), value) in cells.zip(row).filter(|(_, value)| !value.is_nan()) {
                *sum += value;
                *count += 1;
            }
        }
    }
    let mean = |(sum, count): (f64, usize)| sum / count as f64;
    sum.into_iter().zip(count).map(mean).collect()
}

/// `Σ ½ (difference of neighbouring block means)² · rows in a block`, and the number of differences: blocks of `length`
/// finite rows, or of a quarter of the rows of an owner that has fewer than four blocks. Ranges of one owner are
/// consecutive and are read as one.
#[must_use]
pub fn block_differences(
    rows: &[Row],
    ranges: &[[usize; 2]],
    owner: &[usize],
    length: usize,
) -> (Row, usize) {
    let (mut sum, mut n) = ([0.0; 3], 0);
    let mut kept: Vec<Row> = Vec::new();
    for (k, &[start, stop]) in ranges.iter().enumerate() {
        kept.extend(rows[start..stop].iter().filter(|row| is_number(row)));
        if owner.get(k + 1) == Some(&owner[k]) {
            continue;
        }
        let length = length.max(1).min(kept.len() / 4);
        let mut before: Option<Row> = None;
        if length == 0 {
            kept.clear();
            continue;
        }
        for block in kept.chunks_exact(length) {
            let about = block[0];
            let mean: Row = std::array::from_fn(|c| {
                let sum: f64 = block.iter().map(|row| row[c] - about[c]).sum();
                about[c] + sum / length as f64
            });
            if let Some(before) = before {
                for c in 0..3 {
                    sum[c] += 0.5 * (mean[c] - before[c]).powi(2) * length as f64;
                }
                n += 1;
            }
            before = Some(mean);
        }
        kept.clear();
    }
    (sum, n)
}
