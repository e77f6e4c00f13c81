//! Readings centred on their mean and scaled to unit size.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::sensor_model::Model;

/// Centre and scale of readings: `a' = centre + size · u`.
#[derive(Debug, Clone, Copy)]
pub struct Standardisation {
    /// Mean reading.
    pub centre: Vector3<f64>,
    /// Root mean square distance from it.
    pub size: f64,
}

impl Standardisation {
    /// Standardisation of the given readings.
    ///
    /// # Errors
    /// When all readings are the same, or one is missing, infinite or beyond any sensor.
    pub fn of(readings: &[Vector3<f64>]) -> Result<Self> {
        let n = readings.len().max(1) as f64;
        let centre = sums(readings, |x, _| x, &Vector3::zeros()) / n;
        let size = (sums(readings, |x, c| (x - c) * (x - c), &centre).sum() / n).sqrt();
        if !size.is_finite() {
            return Err(Error::bad_input(
                "the readings hold numbers that are missing, infinite or too large for any sensor",
            ));
        }
        if size <= 1e-12 * (1.0 + centre.norm()) {
            return Err(Error::not_determined(
                "all static poses read the same: turn the sensor into different orientations between poses",
            ));
        }
        Ok(Self { centre, size })
    }

    /// The standardised reading `u`.
    #[must_use]
    pub fn apply(&self, reading: &Vector3<f64>) -> Vector3<f64> {
        (reading - self.centre) / self.size
    }

    /// The model of raw readings for a model of standardised ones.
    #[must_use]
    pub fn undo(&self, model: &Model) -> Model {
        let s = model.s / self.size;
        Model {
            s,
            b: model.b - s * self.centre,
        }
    }
}

/// Numbers summed side by side: eight readings, three numbers each.
const WIDE: usize = 24;
/// Readings per share; shares are summed in order.
const SHARE: usize = 16_384;

/// `Σ f(x, c)` of each axis.
fn sums(
    readings: &[Vector3<f64>],
    f: impl Fn(f64, f64) -> f64 + Sync + Send,
    centre: &Vector3<f64>,
) -> Vector3<f64> {
    let beside: [f64; WIDE] = std::array::from_fn(|k| centre[k % 3]);
    let share = |readings: &[Vector3<f64>]| {
        let (rows, rest) = bytemuck::cast_slice::<_, f64>(readings).as_chunks::<WIDE>();
        let mut wide = [0.0; WIDE];
        for row in rows {
            for k in 0..WIDE {
                wide[k] += f(row[k], beside[k]);
            }
        }
        for (k, x) in rest.iter().enumerate() {
            wide[k] += f(*x, beside[k]);
        }
        Vector3::from_fn(|axis, _| wide.iter().skip(axis).step_by(3).sum())
    };
    if readings.len() <= SHARE {
        return share(readings);
    }
    let parts: Vec<Vector3<f64>> = readings.par_chunks(SHARE).map(share).collect();
    parts.into_iter().sum()
}
