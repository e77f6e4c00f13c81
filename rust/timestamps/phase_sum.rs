//! The power of phase sums of timestamps, from which the sampling period is estimated.

use std::f64::consts::PI;
use std::sync::{Arc, Mutex};

use rayon::prelude::*;
use realfft::{RealFftPlanner, RealToComplex};

use crate::error::{Error, Result};

/// Smallest number of the form 2^a 3^b 5^c that is at least `n`: lengths at which a real transform is fast.
#[must_use]
pub fn next_fast_length(n: usize) -> usize {
    let mut best = n.next_power_of_two();
    let mut fives = 1;
    while fives < best {
        let mut odd = fives;
        while odd < best {
            let twos = n.div_ceil(odd).next_power_of_two();
            best = best.min(odd * twos);
            odd *= 3;
        }
        fives *= 5;
    }
    best
}

type Transform = Arc<dyn RealToComplex<f64>>;

/// The transform of a length; the last one is kept: windows of most logs are equally long, and the factors of a
/// transform take longer to compute than its use.
fn transform_of(length: usize) -> Transform {
    static LAST: Mutex<Option<Transform>> = Mutex::new(None);
    // Never waits: a child forked while the lock was held would wait for ever.
    if let Ok(last) = LAST.try_lock()
        && let Some(known) = last.as_ref().filter(|one| one.len() == length)
    {
        return Arc::clone(known);
    }
    let made = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    if let Ok(mut last) = LAST.try_lock() {
        *last = Some(Arc::clone(&made));
    }
    made
}

/// `|mean exp(2πi f t)|²` on the grid of a transform of `length` cells, the mean of all windows by their timestamps.
///
/// Windows are tapered (Hann) to suppress sidelobes; a timestamp is shared linearly between neighbouring cells, which
/// attenuates a frequency by sinc², corrected here. `length / 2 + 1` powers.
///
/// # Errors
/// `BadInput` when a timestamp is not within the cells.
pub fn phase_power(windows: &[&[f64]], cell: f64, length: usize) -> Result<Vec<f64>> {
    if length < 2 {
        return Err(Error::bad_input("a transform needs two cells and more"));
    }
    let transform = transform_of(length);
    let room = || {
        let (spectrum, scratch) = (transform.make_output_vec(), transform.make_scratch_vec());
        (Vec::new(), spectrum, scratch)
    };
    let each: Vec<Option<Vec<f64>>> = windows
        .par_iter()
        .map_init(room, |(shared, spectrum, scratch), window| {
            let n = window.len() as f64;
            shared.clear();
            shared.resize(length + 1, 0.0);
            let mut taken = 0.0;
            for (i, stamp) in window.iter().enumerate() {
                let position = stamp / cell;
                // A timestamp beyond the cells, or NaN, has no cell.
                if !(position >= 0.0 && position < length as f64) {
                    return None;
                }
                let taper = (PI * (i as f64 + 0.5) / n).sin().powi(2);
                let share = position.fract();
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "checked above"
                )]
                let at = position as usize;
                shared[at] += (1.0 - share) * taper;
                shared[at + 1] += share * taper;
                taken += taper;
            }
            shared.truncate(length);
            transform
                .process_with_scratch(shared, spectrum, scratch)
                .ok()?;
            let scale = n / (taken * taken);
            Some(spectrum.iter().map(|z| scale * z.norm_sqr()).collect())
        })
        .collect();
    let mut power = vec![0.0; length / 2 + 1];
    for window in each {
        let window =
            window.ok_or_else(|| Error::bad_input("a timestamp lies outside the cells"))?;
        for (sum, value) in power.iter_mut().zip(&window) {
            *sum += value;
        }
    }
    let timestamps: usize = windows.iter().map(|w| w.len()).sum();
    for (k, value) in power.iter_mut().enumerate() {
        let angle = PI * k as f64 / length as f64;
        let damped = if k == 0 { 1.0 } else { angle.sin() / angle };
        *value /= timestamps as f64 * damped.powi(4);
    }
    Ok(power)
}

/// Power of the mean of `exp(2πi f t)` at `count` frequencies from `first` on, `step` apart.
#[must_use]
pub fn direct_power(timestamps: &[f64], first: f64, step: f64, count: usize) -> Vec<f64> {
    // Every phase advances from one frequency to the next by a fixed rotation, which replaces exponentials.
    let turn_by = |f: f64| timestamps.iter().map(move |t| (2.0 * PI * f * t).sin_cos());
    let (mut re, mut im) = (
        Vec::with_capacity(timestamps.len()),
        Vec::with_capacity(timestamps.len()),
    );
    for (sin, cos) in turn_by(first) {
        re.push(cos);
        im.push(sin);
    }
    let turns: Vec<(f64, f64)> = turn_by(step).collect();
    let n = timestamps.len() as f64;
    (0..count)
        .map(|_| {
            let sums = (re.iter().sum::<f64>() / n, im.iter().sum::<f64>() / n);
            for ((x, y), (sin, cos)) in re.iter_mut().zip(im.iter_mut()).zip(&turns) {
                (*x, *y) = (*x * cos - *y * sin, *x * sin + *y * cos);
            }
            sums.0 * sums.0 + sums.1 * sums.1
        })
        .collect()
}
