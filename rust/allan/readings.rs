//! Source of the readings of one channel: an array of any number type, a column of rows.

/// Readings of one channel; one that is not finite is missing.
#[expect(
    clippy::len_without_is_empty,
    reason = "a channel without readings is an error where one is asked for"
)]
pub trait Readings: Sync {
    /// Number of readings.
    fn len(&self) -> usize;

    /// Reading `i`.
    fn get(&self, i: usize) -> f64;

    /// Readings from `first` on, as many as `out` holds.
    fn fill(&self, first: usize, out: &mut [f64]) {
        for (i, v) in out.iter_mut().enumerate() {
            *v = self.get(first + i);
        }
    }
}

/// Column `channel` of rows of `channels` readings.
#[derive(Debug, Clone, Copy)]
pub struct Column<'a, T> {
    /// All readings, row by row.
    pub data: &'a [T],
    /// Readings per row.
    pub channels: usize,
    /// Index of the channel.
    pub channel: usize,
}

impl<T: Copy + Into<f64> + Sync> Readings for Column<'_, T> {
    fn len(&self) -> usize {
        self.data.len() / self.channels
    }

    fn get(&self, i: usize) -> f64 {
        self.data[i * self.channels + self.channel].into()
    }

    fn fill(&self, first: usize, out: &mut [f64]) {
        let data = &self.data[first * self.channels..(first + out.len()) * self.channels];
        if self.channels == 1 {
            for (v, &reading) in out.iter_mut().zip(data) {
                *v = reading.into();
            }
        } else {
            for (v, row) in out.iter_mut().zip(data.chunks_exact(self.channels)) {
                *v = row[self.channel].into();
            }
        }
    }
}
