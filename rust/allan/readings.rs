//! Source of the readings of one channel: an array of any number type, a column of rows, a function.

/// Readings of one channel; one that is not finite is missing.
pub trait Readings: Sync {
    /// Number of readings.
    fn len(&self) -> usize;

    /// Reading `i`.
    fn get(&self, i: usize) -> f64;

    /// Whether there are no readings.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

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

/// Readings given by a function of their index.
#[derive(Debug, Clone, Copy)]
pub struct FromFn<F>(pub usize, pub F);

impl<F: Fn(usize) -> f64 + Sync> Readings for FromFn<F> {
    fn len(&self) -> usize {
        self.0
    }

    fn get(&self, i: usize) -> f64 {
        (self.1)(i)
    }
}
